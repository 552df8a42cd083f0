#pragma once

#include "estimation/estimator_config.hpp"

namespace fiducap {

// "Unknown" for a linear filter whose linearisation point is already right: far beyond any room,
// small enough for double; velocity and rate as at a start.
inline constexpr double kUnknownPosition_m = 30.0;
inline constexpr double kUnknownAngle_rad = 2.0;
inline constexpr double kStartVelocity_m_s = 1.0;
inline constexpr double kStartRate_rad_s = 1.0;  // without IMU

/// Which axis of the reference tag gives the heading, and where the tag shall stand. Fixed once
/// chosen.
struct HeadingRule {
  int axis{0};        ///< 0 x, 1 y, 2 z of the tag: the most level one.
  double yaw_rad{0};  ///< Heading of that axis in W.
  Pose X_WT;          ///< Where the tag shall stand (position; without gravity: the whole pose).
};

/// @param q_WT  the tag's attitude in any level axes, to find its most level axis when the survey
/// gives none
[[nodiscard]] HeadingRule make_heading_rule(const WorkspaceGauge& gauge,
                                            const Eigen::Quaterniond& q_WT);

/// The turning about z that gives the tag the heading of the rule.
[[nodiscard]] Eigen::Quaterniond turn_to_heading(const HeadingRule& rule,
                                                 const Eigen::Quaterniond& q_WT);

/// The turning about z that brings `q_WT` closest to `wanted_q_WT`.
[[nodiscard]] Eigen::Quaterniond turn_closest(const Eigen::Quaterniond& wanted_q_WT,
                                              const Eigen::Quaterniond& q_WT);

/// Yaw and shift, all of the turn when gravity does not say what is up (`level`), that bring one
/// pose over another as well as that can be: X_new_old.
[[nodiscard]] Pose axes_between(const Pose& from, const Pose& to, bool level);

}  // namespace fiducap
