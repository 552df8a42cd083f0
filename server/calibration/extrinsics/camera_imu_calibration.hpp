#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "calibration/extrinsics/loaded_samples.hpp"
#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

/// Clock offset of the images.
struct ShiftResult {
  double shift_s{};
  double sigma_s{};
  bool at_border{false};  ///< It is outside of the range.
  bool determined{true};  ///< False: the rotations do not show it; `shift_s` is 0 then.
};

struct CalibrationOptions {
  double position_sigma_m{0.02};  ///< Prior sigma of the recording's X_BV, per axis.
  double rotation_sigma_rad{0.035};
  double time_range_s{0.05};  ///< Expected on both sides of the recording's own time shift.
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

/// Measures the time shift by the rotations of cameras and gyroscope (TimeOffset), then runs the
/// filter twice over the samples, from the first rest with tags in view on, for extrinsics and
/// clocks together. The
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
