#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calibration/extrinsics/sample_replay.hpp"
#include "calibration/extrinsics/time_shift_search.hpp"
#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

struct CalibrationOptions {
  double position_sigma_m{0.02};  ///< How far the recording's X_BV may be off, per axis.
  double rotation_sigma_rad{0.035};
  double time_range_s{0.05};  ///< Searched on both sides of the recording's own time shift.
  bool search_time{true};
};

/// One number of X_BV.
struct AxisVerdict {
  double sigma{};  ///< m or rad, B axes.
  double prior_sigma{};
  bool observed{};  ///< Below half of what was known before, and below 3 mm or 1 mrad.
};

struct CameraVerdict {
  Pose X_BV;
  std::array<AxisVerdict, 6> axes;  ///< Position x y z, rotation vector x y z.
  double moved_m{};                 ///< Away from the recording's own X_BV.
  double moved_rad{};
};

struct CameraImuCalibration {
  std::vector<CameraMount> cameras;     ///< The recording's, with new X_BV, sigmas and time shift.
  std::vector<CameraVerdict> verdicts;  ///< One per camera.
  /// On top of the recording's own time shifts: mean of all cameras, as solved for with their
  /// places.
  ShiftResult time;
  OfflineStatistics statistics;  ///< Of the last run.
  int runs{};
  /// No calm with tags in view was found: may be wrong and sure (CalmWatch).
  bool begins_in_motion{};
};

/// Called before each run of the filter.
using CalibrationProgress = std::function<void(const std::string& what)>;

/// Runs the filter over the samples, from the first calm with tags in view on: first with images
/// shifted until its innovations are smallest, then twice for extrinsics and clocks together; the
/// second run is linearised at the first's result and starts with the same sigmas as the first, so
/// that nothing counts twice.
/// @param setup  of the recording; its filter and noises are used
/// @return Error without IMU, without tags, or when the filter never started
[[nodiscard]] Expected<CameraImuCalibration> calibrate_camera_imu(
    OfflineSetup setup, const LoadedSamples& samples, const CalibrationOptions& options,
    const CalibrationProgress& progress = {});

/// Which motion would show an axis: `axis` as in CameraVerdict::axes.
[[nodiscard]] std::string motion_that_shows(std::size_t axis);

/// Kalibr's camchain-imucam, as read_kalibr_camchain reads it.
[[nodiscard]] std::string to_kalibr_camchain(const std::vector<CameraMount>& cameras,
                                             const std::string& heading);

}  // namespace fiducap
