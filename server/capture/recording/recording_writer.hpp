#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/output_file.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {

/// Writes a recording: images as PNG, corners, IMU, truth (nine decimals; sensor data are exact).
/// Lines go to disk at `flush`. Never overwrites a folder with content.
class RecordingWriter final {
 public:
  [[nodiscard]] static Expected<RecordingWriter> create(const RecordingInfo& info);

  [[nodiscard]] Expected<void> write(const SensorSample& sample) {
    return std::visit([this](const auto& s) { return append(s); }, sample);
  }
  [[nodiscard]] Expected<void> write_truth(const TruthSample& truth);
  [[nodiscard]] Expected<void> write_truth_tags(const std::vector<RecordedTag>& tags);
  [[nodiscard]] Expected<void> write_truth_extrinsics(const std::vector<Pose>& X_BV) {
    return write_text(layout_.truth_extrinsics_yaml(), extrinsics_yaml(X_BV));
  }
  /// Hands all lines to the system: what was written survives the end of the process.
  [[nodiscard]] Expected<void> flush() { return on_all(&LazyCsv::flush); }
  /// Closes all files. @return Error when the disk did not take everything
  [[nodiscard]] Expected<void> finish() { return on_all(&LazyCsv::close); }
  [[nodiscard]] std::uint64_t bytes() const {  // that the system accepted
    std::uint64_t all = whole_files_bytes_ + imu_.bytes() + state_.bytes();
    for (const CameraFiles& camera : cameras_)
      all += camera.images.bytes() + camera.corners.bytes() + camera.frames.bytes();
    return all;
  }

 private:
  /// A file that is created with its first line.
  class LazyCsv final {
   public:
    Expected<CsvWriter*> get(const std::filesystem::path& path, const char* header);
    Expected<void> flush() { return writer_ ? writer_->flush() : Expected<void>{}; }
    Expected<void> close() { return writer_ ? writer_->close() : Expected<void>{}; }
    [[nodiscard]] std::uint64_t bytes() const { return writer_ ? writer_->bytes() : 0; }

   private:
    std::optional<CsvWriter> writer_;
  };
  struct CameraFiles {
    LazyCsv images;
    LazyCsv corners;
    LazyCsv frames;
  };

  explicit RecordingWriter(const RecordingInfo& info)
      : layout_(info.folder),
        info_(info),
        R_IB_(info.X_BI.rotation().transpose()),
        cameras_(info.cameras.size()) {}
  Expected<void> write_calibration();
  Expected<void> append(const ImuSample& sample);
  Expected<void> append(const CameraFrame& frame);
  Expected<void> append(const CornerFrame& frame);
  Expected<void> write_text(const std::filesystem::path& path, const std::string& text);
  Expected<std::int64_t> camera_stamp(int camera, Instant exposed_at) const;
  /// @return the first failure
  Expected<void> on_all(Expected<void> (LazyCsv::*action)());

  RecordingLayout layout_;
  RecordingInfo info_;
  Eigen::Matrix3d R_IB_;
  std::vector<CameraFiles> cameras_;
  LazyCsv imu_;
  LazyCsv state_;
  std::uint64_t whole_files_bytes_{0};  ///< Images and small files.
  std::vector<std::uint8_t> scratch_;
};

}  // namespace fiducap
