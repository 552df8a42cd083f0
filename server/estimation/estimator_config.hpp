#pragma once

#include <optional>
#include <vector>

#include "base/config_check.hpp"
#include "base/pose.hpp"

namespace fiducap {

/// Noise of the sensors and acceptance of tags. Noises are 1-sigma; the IMU's densities come with
/// the body (`bodies[].imu`).
struct EstimatorConfig {
  double corner_noise_px{0.4};  ///< n_p: each coordinate of each corner, raw pixels (RCARS II-D2).
  bool learn_corner_noise{true};   ///< False: corner_noise_px holds for every corner.
  bool estimate_extrinsics{true};  ///< False: X_BV is taken as exact.
  bool estimate_clocks{true};      ///< False: time_shift_s and readout_s of each camera are exact.
  /// Lens, shutter and tag sizes are estimated once they differ significantly from the configured
  /// ones, and the noises of IMU and stamps are learned; filter `world`, bodies with an IMU. False:
  /// the configuration is taken as exact.
  bool doubt_configuration{true};
  /// Lens of every camera is estimated from the first image on; filter `world`. False: only lenses
  /// with a `focal_sigma`, `centre_sigma_px` or `k1_sigma`.
  bool refine_intrinsics{false};
  /// Also track image points other than tags; needs images, an IMU and filter `world`.
  bool landmarks{false};
  double gate_probability{0.999};  ///< Quantile of chi-square below which a tag is used.
  int max_local_tags{200};  ///< Tags in the state; further ones are ignored and reported once.
  /// Chi-square by which the second planar pose must be worse before a tag is accepted.
  double branch_evidence{20.0};
  int branch_views{10};       ///< Views of a tag that are compared while its branch is open.
  double max_imu_gap_s{0.1};  ///< Longer holes in the IMU stream are bridged by the motion model.
  double motion_accel_m_s2_rtHz{3.0};      ///< Bodies without IMU: white noise acceleration.
  double motion_angular_rad_s2_rtHz{6.0};  ///< Bodies without IMU: white angular acceleration.

  [[nodiscard]] std::vector<ConfigError> check() const {
    return Checker{"estimator."}
        .positive("corner_noise_px", corner_noise_px)
        .within("gate_probability", gate_probability, 0.9, 0.999999)
        .within("max_local_tags", max_local_tags, 1, 1000)
        .positive("branch_evidence", branch_evidence)
        .within("branch_views", branch_views, 1, 100)
        .positive("max_imu_gap_s", max_imu_gap_s)
        .positive("motion_accel_m_s2_rtHz", motion_accel_m_s2_rtHz)
        .positive("motion_angular_rad_s2_rtHz", motion_angular_rad_s2_rtHz)
        .errors;
  }
};

/// Definition of the workspace while no tag is known: position and heading of one tag; the vertical
/// comes from gravity. Bodies without IMU use the tag's whole pose, or floor tags for the vertical.
struct WorkspaceGauge {
  std::optional<int> reference_tag;  ///< nullopt: the first tag that is seen.
  std::optional<Pose> X_WT;  ///< Its surveyed pose; nullopt: origin, heading by the tag's x axis.
  /// Tags that lie flat, face up: bodies without IMU wait for all of them and take the vertical
  /// from them. Ignored when X_WT is given.
  std::vector<int> floor_tags{};

  [[nodiscard]] bool stands_by_floor() const { return !X_WT && !floor_tags.empty(); }
};

}  // namespace fiducap
