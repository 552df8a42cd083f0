#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/config_check.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// The world axes N an autopilot is told about. Its body axes are always F: x forward, y right, z
/// down.
enum class AutopilotWorld {
  kNed,  ///< North, east, down. W is taken as east, north, up (REP-103): x' = y, y' = x, z' = −z.
  kFrd,  ///< Heading unknown to the compass: x' = x, y' = −y, z' = −z.
};

/// A body's pivot as PX4 and ArduPilot understand it. P is taken as x forward, y left, z up.
struct AutopilotOdometry {
  Eigen::Vector3d p_NF;     ///< m, N.
  Eigen::Quaterniond q_NF;  ///< Turns F vectors into N vectors.
  Eigen::Vector3d v_NF;     ///< m/s, N.
  Eigen::Vector3d v_NF_F;   ///< m/s, F.
  Eigen::Vector3d w_NF_F;   ///< rad/s, F.
  /// x, y, z (N), roll, pitch, yaw: about the axes of the heading (N turned by the yaw), small
  /// angles. Exact while the body is level, bounded when it points straight up, where the three
  /// angles themselves are not.
  Matrix6d pose_covariance;
  Matrix6d twist_covariance;          ///< Velocity (F), body rate (F). The velocity's includes the
                                      ///< attitude's doubt.
  Eigen::Vector3d velocity_variance;  ///< (m/s)², N.
};

[[nodiscard]] AutopilotOdometry to_autopilot(const BodyPose& body, AutopilotWorld world);

/// Roll, pitch, yaw of q_NF: turns about x, then y, then z of N. Pitch in [−π/2, π/2].
[[nodiscard]] Eigen::Vector3d roll_pitch_yaw(const Eigen::Quaterniond& q_NF);

/// Velocity in the body's own axes P and body rate, with the doubt about the attitude that turns
/// it. Rows: v_P, w_P.
[[nodiscard]] Matrix6d body_twist_covariance(const BodyPose& body);

/// 1..100 while the pose may be used, −1 otherwise. 100 at 1 cm and 1 degree or better, less by the
/// worse of the two; at most 50 while no tag is seen.
[[nodiscard]] std::int8_t autopilot_quality(const BodyPose& body);

namespace words {

inline constexpr std::array<Word<AutopilotWorld>, 2> kAutopilotWorld{
    {{"ned", AutopilotWorld::kNed}, {"frd", AutopilotWorld::kFrd}}};

}  // namespace words

}  // namespace fiducap
