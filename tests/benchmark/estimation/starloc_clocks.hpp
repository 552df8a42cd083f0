#pragma once

#include <vector>

#include "estimation/starloc_run.hpp"

namespace fiducap::bench {

/// The camera against Vicon: where it sits on the rig and how its clock runs, by least squares over
/// all centres.
struct CameraClock {
  Pose X_RV;
  double offset_s{};  ///< t_vicon = t_camera + offset, in the middle of the run.
  double offset_sigma_s{};
  double window_scatter_s{};  ///< Standard deviation of the offset over windows of 10 s, drift
                              ///< taken out.
  double drift{};             ///< Seconds per second.
  double drift_sigma{};
  double reprojection_median_px{};
  double period_median_s{};  ///< Of images with tags.
  double longest_gap_s{};    ///< Without any tag.
  std::size_t images{};

  [[nodiscard]] double to_vicon(double t_s, double middle_s) const {
    return t_s + offset_s + drift * (t_s - middle_s);
  }
};

/// The IMU against Vicon, by its rates.
struct ImuClock {
  Eigen::Quaterniond q_RI{Eigen::Quaterniond::Identity()};
  double offset_s{};          ///< t_vicon = t_imu + offset
  double window_scatter_s{};  ///< Standard deviation of the offset over windows of 10 s.
  double drift{};             ///< Of the line through the windows.
  double rate_rms_rad_s{};    ///< What is left.
  double period_median_s{};
  double lost_share{};  ///< Steps longer than 1.5 medians.
  double longest_gap_s{};
};

[[nodiscard]] CameraClock measure_camera_clock(const StarlocRun& run);
/// @pre !run.imu.empty()
[[nodiscard]] ImuClock measure_imu_clock(const StarlocRun& run);

/// The middle of the run on the camera's clock.
[[nodiscard]] double middle_of(const StarlocRun& run);

}  // namespace fiducap::bench
