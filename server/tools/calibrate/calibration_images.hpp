#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/camera_frame.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// One image to look for a target in, or what another detector found in it already.
struct CalibrationImage {
  std::string name;
  std::shared_ptr<const GrayImage> image;  ///< Null when there are corners only.
  CornerFrame corners;
  int width{};
  int height{};
};

/// Images of one camera, calibrated or not: a folder of pictures, a video file, or a recording.
class CalibrationImages final {
 public:
  /// @param camera  which camera of a recording
  /// @return Error saying what was expected
  [[nodiscard]] static Expected<CalibrationImages> open(const std::string& path,
                                                        std::size_t camera);

  /// @return nullopt at the end. Pictures that cannot be read are left out and counted.
  [[nodiscard]] Expected<std::optional<CalibrationImage>> next();

  [[nodiscard]] std::size_t left_out() const { return left_out_; }
  /// How many there are; 0: not known before.
  [[nodiscard]] std::size_t total() const { return files_.size(); }
  /// What a recording says about its tags; nullopt for pictures and videos.
  [[nodiscard]] const std::optional<RecordingInfo>& recording() const { return recording_; }

 private:
  [[nodiscard]] static Expected<CalibrationImages> open_recorded(const std::string& path,
                                                                 std::size_t camera);
  [[nodiscard]] static Expected<CalibrationImages> open_folder(const std::string& path);
  [[nodiscard]] std::optional<CalibrationImage> next_file();
  [[nodiscard]] Expected<std::optional<CalibrationImage>> next_sample();

  std::vector<std::filesystem::path> files_;
  std::size_t next_file_{0};
  std::vector<std::uint8_t> scratch_;
  std::unique_ptr<SensorSource> source_;
  std::optional<RecordingInfo> recording_;
  std::size_t camera_{0};
  std::size_t seen_{0};
  std::size_t left_out_{0};
};

}  // namespace fiducap
