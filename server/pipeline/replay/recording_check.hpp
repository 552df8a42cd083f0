#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/recording/recording.hpp"

namespace fiducap {

/// One file of stamped lines.
struct RecordedStream {
  std::string file;          ///< Below the folder of the recording, e.g. `mav0/imu0/data.csv`.
  std::size_t stamps{};      ///< Lines that have one.
  std::size_t left_out{};    ///< … out of order, or far from the others.
  std::size_t unreadable{};  ///< Lines without; a header counts.
  std::string first_unreadable{};
  double rate_hz{};  ///< As the calibration says.
  Instant first{};   ///< On the IMU's clock, as far as the time shift says.
  Instant last{};
  Duration step{};  ///< Median.
};

/// Something that a person should know before trusting what is made of a recording.
struct RecordingFinding {
  bool unusable{};   ///< Nothing sensible can come of it.
  std::string text;  ///< What is wrong, its likely cause, what to do.
};

struct RecordingReport {
  std::vector<RecordedStream> streams;
  std::vector<RecordingFinding> findings;  ///< The likeliest causes of failure first.

  [[nodiscard]] bool is_usable() const;
};

/// Reads stamps, IMU and corners of a whole recording, and says what cannot be: units of stamps and
/// readings, clocks that have nothing in common, streams that are missing or end early, mirrored
/// corners. Images are not opened.
/// @return Error when a file cannot be read
[[nodiscard]] Expected<RecordingReport> check_recording(const RecordingInfo& info);

}  // namespace fiducap
