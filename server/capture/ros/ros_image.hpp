#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "base/expected.hpp"
#include "capture/gray_image.hpp"
#include "capture/lens/camera_model.hpp"

struct sensor_msgs_msg_dds__CameraInfo_;

namespace fiducap::dds {

/// sensor_msgs/Image as it came; nothing in it is to be believed.
struct RawImage {
  std::uint32_t width{};
  std::uint32_t height{};
  std::string_view encoding;
  bool is_bigendian{};
  std::uint32_t step{};  ///< Bytes per row.
  std::span<const std::uint8_t> data;
};

/// @return Error when the size is not the calibration's, the encoding is unknown or the bytes do
/// not fit the size
[[nodiscard]] Expected<void> to_gray(const RawImage& image, const CameraModel& camera,
                                     GrayImage& out);
/// JPEG or PNG. The size is judged before anything is decoded.
[[nodiscard]] Expected<void> decode_gray(std::span<const std::uint8_t> encoded,
                                         const CameraModel& camera, GrayImage& out);
/// @return Error for a model that we do not have, for binned or cut images, and for numbers that
/// are none
[[nodiscard]] Expected<CameraModel> camera_model(const sensor_msgs_msg_dds__CameraInfo_& info);

}  // namespace fiducap::dds
