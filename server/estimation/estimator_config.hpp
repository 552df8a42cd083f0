#pragma once

#include <optional>
#include <vector>

#include "base/config_check.hpp"
#include "base/pose.hpp"
#include "base/time.hpp"

namespace fiducap {

/// How much the filter trusts each sensor, and when it believes a tag. Noises are 1-sigma.
/// The IMU's own densities come with the body (ImuNoise).
struct EstimatorConfig {
  double corner_noise_px{0.4};  ///< n_p: each coordinate of each corner, raw pixels (RCARS II-D2).
  bool learn_corner_noise{true};   ///< False: corner_noise_px holds for every corner.
  bool estimate_extrinsics{true};  ///< False: X_BV is taken as exact.
  bool estimate_clocks{
      true};  ///< False: each camera's time_shift_s and readout_s are taken as exact.
  /// Lens, shutter and print sizes are estimated once they are surely not as configured, and the
  /// noises of IMU and stamps are learned; filter `world`, bodies with an IMU. False: all that is
  /// configured is believed.
  bool doubt_configuration{true};
  /// Focal length and centre of every camera are estimated from the first image on, for good;
  /// filter `world`. False: only those whose sigmas are told (CameraMount).
  bool refine_intrinsics{false};
  bool landmarks{false};  ///< Also follow points of the image that are no tags; needs images, an
                          ///< IMU and filter `world`.
  double gate_probability{
      0.999};               ///< A tag is used when its joint chi-square is below this quantile.
  int max_local_tags{200};  ///< Tags in the state; further ones are ignored and reported once.
  int hand_over_above{
      120};  ///< More tags in the state than this: the map takes the one unseen for longest.
  double branch_evidence{
      20.0};  ///< Chi-square by which the second planar pose must lose before a tag is believed.
  int branch_views{10};       ///< Views of a tag that are compared while its branch is open.
  double max_imu_gap_s{0.1};  ///< Longer holes in the IMU stream are bridged by the motion model.
  double motion_accel_m_s2_rtHz{3.0};  ///< Bodies without IMU: white noise acceleration.
  double motion_angular_rad_s2_rtHz{
      6.0};  ///< Bodies without IMU: white noise angular acceleration.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// What makes W the workspace when no tag is known yet: one tag's place and heading; up is
/// gravity's business. Bodies without IMU take the whole pose, unless tags say what is up.
struct WorkspaceGauge {
  std::optional<int> reference_tag;  ///< nullopt: the first tag that is seen.
  std::optional<Pose> X_WT;  ///< Its surveyed pose; nullopt: origin, heading by the tag's x axis.
  /// Tags that lie flat, face up: bodies without IMU wait for all of them, and stand upright by
  /// them. Not looked at when X_WT says it.
  std::vector<int> floor_tags{};

  [[nodiscard]] bool stands_by_floor() const { return !X_WT && !floor_tags.empty(); }
};

}  // namespace fiducap
