#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "capture/gray_image.hpp"
#include "capture/lens/camera_model.hpp"

/// Images and lenses of ROS messages, received by DDS or read from a file.
namespace fiducap::ros {

/// sensor_msgs/Image as received, not validated.
struct RawImage {
  std::uint32_t width{};
  std::uint32_t height{};
  std::string_view encoding;
  bool is_bigendian{};
  std::uint32_t step{};  ///< Bytes per row.
  std::span<const std::uint8_t> data;
};

/// The lens in a sensor_msgs/CameraInfo.
struct CameraInfo {
  std::uint32_t width{};
  std::uint32_t height{};
  std::string_view distortion_model;
  std::span<const double> coefficients;
  std::array<double, 9> K{};   ///< Row by row.
  std::array<double, 12> P{};  ///< Of rectified images; all 0: not given.
  std::uint32_t binning_x{};
  std::uint32_t binning_y{};
  std::uint32_t roi_x{};
  std::uint32_t roi_y{};
};

/// Bits that the values of a 16-bit image need, 8 to 16; 8 for any other image.
[[nodiscard]] int used_bits(const RawImage& image);

/// Converts the images of one camera to gray. Of 16-bit channels it takes the eight highest bits
/// that any image so far has used: sensors with 10, 12 or 14 bits leave the others zero.
class GrayConversion final {
 public:
  /// @param bits  used at least
  explicit GrayConversion(int bits = 8) : bits_(bits) {}
  /// @return Error for another size than the calibrated one, an unknown encoding or missing bytes
  [[nodiscard]] Expected<void> convert(const RawImage& image, const CameraModel& camera,
                                       GrayImage& out);

 private:
  int bits_;
  std::vector<std::uint8_t> scratch_;
};

/// @return Error for an unknown lens model, for binned or cropped images, and for invalid numbers
[[nodiscard]] Expected<CameraModel> camera_model(const CameraInfo& info, bool of_rectified = false);

/// `/cam0/image_raw` → `/cam0/camera_info`, also of `/cam0/image_raw/compressed`.
[[nodiscard]] std::string camera_info_topic(const std::string& image_topic);
[[nodiscard]] bool is_compressed(const std::string& image_topic);
/// By its name (`image_rect`, `image_rect_raw`): undistorted, so P holds instead of K.
[[nodiscard]] bool is_rectified(const std::string& image_topic);

}  // namespace fiducap::ros
