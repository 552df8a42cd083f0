#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "calibration/extrinsics/loaded_samples.hpp"
#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

/// Minimum of a cost over the clock offset.
struct ShiftResult {
  double shift_s{};
  double sigma_s{};       ///< From the curvature: the cost is a chi-square.
  bool at_border{false};  ///< The minimum lies outside of the range.
  bool determined{true};  ///< False: the cost hardly depends on the shift; `shift_s` is 0 then.
};

/// Chi-square of the recording with this delay added to its images.
using ShiftCost = std::function<Expected<double>(double shift_s)>;

/// Minimum in ±range_s: a coarse grid, a golden section in its best cell, and a parabola through
/// five points, because a filter's cost has many small local minima.
/// @return Error of the first cost that fails
[[nodiscard]] Expected<ShiftResult> search_time_shift(const ShiftCost& cost, double range_s);

struct CalibrationOptions {
  double position_sigma_m{0.02};  ///< Prior sigma of the recording's X_BV, per axis.
  double rotation_sigma_rad{0.035};
  double time_range_s{0.05};  ///< Searched on both sides of the recording's own time shift.
  bool search_time{true};
};

/// One component of X_BV.
struct AxisVerdict {
  double sigma{};  ///< m or rad, B axes.
  double prior_sigma{};
  bool observed{};  ///< Sigma below half of the prior, and below 3 mm or 1 mrad.
};

struct CameraVerdict {
  Pose X_BV;
  std::array<AxisVerdict, 6> axes;  ///< Position x y z, rotation vector x y z.
  double moved_m{};                 ///< Distance from the recording's own X_BV.
  double moved_rad{};
};

struct CameraImuCalibration {
  std::vector<CameraMount> cameras;     ///< The recording's, with new X_BV, sigmas and time shift.
  std::vector<CameraVerdict> verdicts;  ///< One per camera.
  /// Added to the recording's own time shifts: mean of all cameras, estimated with their poses.
  ShiftResult time;
  OfflineStatistics statistics;  ///< Of the last run.
  int runs{};
  /// No rest with tags in view was found: the result may be inconsistent (StillnessDetector).
  bool begins_in_motion{};
};

/// Called before each run of the filter.
using CalibrationProgress = std::function<void(const std::string& what)>;

/// Runs the filter over the samples, from the first rest with tags in view on: first to find the
/// time shift with the smallest innovations, then twice for extrinsics and clocks together. The
/// second run is linearised at the first one's result and starts with the same sigmas, so that no
/// measurement counts twice.
/// @param setup  of the recording; its filter and noises are used
/// @return Error without IMU, without tags, or when the filter never started
[[nodiscard]] Expected<CameraImuCalibration> calibrate_camera_imu(
    OfflineSetup setup, const LoadedSamples& samples, const CalibrationOptions& options,
    const CalibrationProgress& progress = {});

/// The motion that makes an axis observable: `axis` as in CameraVerdict::axes.
[[nodiscard]] std::string motion_for_axis(std::size_t axis);

/// Kalibr's camchain-imucam, as read by read_kalibr_camchain.
[[nodiscard]] std::string to_kalibr_camchain(const std::vector<CameraMount>& cameras,
                                             const std::string& heading);

}  // namespace fiducap
