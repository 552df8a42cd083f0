#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/recording/recording.hpp"

namespace fiducap {

/// Writes a recording that read_recording_info and open_recording read back: images as PNG,
/// corners, IMU, truth. What sensors said is written to the last bit, truth to nine decimals.
/// Lines go to disk at `flush`. Never overwrites a folder with content.
class RecordingWriter final {
 public:
  [[nodiscard]] static Expected<RecordingWriter> create(const RecordingInfo& info);
  ~RecordingWriter();
  RecordingWriter(RecordingWriter&&) noexcept;
  RecordingWriter& operator=(RecordingWriter&&) noexcept;

  [[nodiscard]] Expected<void> write(const SensorSample& sample);
  [[nodiscard]] Expected<void> write_truth(const TruthSample& truth);
  [[nodiscard]] Expected<void> write_truth_tags(const std::vector<RecordedTag>& tags);
  [[nodiscard]] Expected<void> write_truth_extrinsics(const std::vector<Pose>& X_BV);
  /// Hands all lines to the system: what was written survives the end of the process.
  [[nodiscard]] Expected<void> flush();
  /// Closes all files and says whether the disk took everything.
  [[nodiscard]] Expected<void> finish();
  /// That the system took.
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  class Impl;
  explicit RecordingWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
