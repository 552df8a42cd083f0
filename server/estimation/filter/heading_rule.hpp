#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "base/pose.hpp"
#include "estimation/estimator_config.hpp"

namespace fiducap {

// Initial 1-sigma of a lost or new body whose linearisation point is already good: beyond any room,
// small enough for double precision.
inline constexpr double kUnknownPosition_m = 30.0;
inline constexpr double kUnknownAngle_rad = 2.0;
inline constexpr double kStartVelocity_m_s = 1.0;
inline constexpr double kStartRate_rad_s = 1.0;  // without IMU

/// Defines W by a reference tag: the axis that gives the heading, and the tag's pose. Constant once
/// chosen.
struct HeadingRule {
  int axis{0};        ///< 0 x, 1 y, 2 z of the tag: the most level one.
  double yaw_rad{0};  ///< Heading of that axis in W.
  Pose X_WT;          ///< Position of the tag; without gravity its whole pose.
};

/// @param q_WT  in any level axes; selects the tag's most level axis when no survey is given
[[nodiscard]] HeadingRule make_heading_rule(const WorkspaceGauge& gauge,
                                            const Eigen::Quaterniond& q_WT);

/// The rotation about z that gives the tag the heading of the rule.
[[nodiscard]] Eigen::Quaterniond turn_to_heading(const HeadingRule& rule,
                                                 const Eigen::Quaterniond& q_WT);

/// The rotation about z that brings `q_WT` closest to `wanted_q_WT`.
[[nodiscard]] Eigen::Quaterniond turn_closest(const Eigen::Quaterniond& wanted_q_WT,
                                              const Eigen::Quaterniond& q_WT);

/// X_new_old that maps one pose to another: translation and heading, or the full rotation when not
/// `level` (no gravity).
[[nodiscard]] Pose axes_between(const Pose& from, const Pose& to, bool level);

/// The vertical from tags that lie flat, face up. Three or more tags well apart define it by their
/// positions, which is more accurate than by their normals (paper bends).
/// @param X_AT  in any fixed axes A
/// @return in A; nullopt: no tag, or the normals disagree
[[nodiscard]] std::optional<Eigen::Vector3d> up_by_floor(std::span<const Pose> X_AT);

/// A tag's attitude in level axes whose x axis is along the tag's x axis, or along its y axis when
/// x is steep.
[[nodiscard]] Eigen::Quaterniond upright_attitude(const Eigen::Quaterniond& q_AT,
                                                  const Eigen::Vector3d& up_A);

}  // namespace fiducap
