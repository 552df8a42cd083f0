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
  std::size_t stamps{};      ///< Lines with a stamp.
  std::size_t left_out{};    ///< … out of order, or far from the others.
  std::size_t unreadable{};  ///< Lines without a stamp; a header counts.
  std::string first_unreadable{};
  double rate_hz{};  ///< As calibrated.
  Instant first{};   ///< On the IMU's clock, by the calibrated time shift.
  Instant last{};
  Duration step{};  ///< Median.
};

/// A defect of a recording.
struct RecordingFinding {
  bool unusable{};   ///< No sensible result is possible.
  std::string text;  ///< The defect, its likely cause, a remedy.
};

struct RecordingReport {
  std::vector<RecordedStream> streams;
  std::vector<RecordingFinding> findings;  ///< The likeliest causes of failure first.

  [[nodiscard]] bool is_usable() const;
};

/// Checks stamps, IMU and corners of a whole recording: units of stamps and readings, clocks
/// without common time, streams that are missing or end early, mirrored corners. Images are not
/// opened.
/// @return Error when a file cannot be read
[[nodiscard]] Expected<RecordingReport> check_recording(const RecordingInfo& info);

}  // namespace fiducap
