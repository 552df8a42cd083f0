#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/config_check.hpp"
#include "base/pose.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// The vertical axis for a client; inside the server it is z.
/// y-up: x' = x, y' = z, z' = -y, that is the axes of the world turned by -90 degrees about x.
/// z-down: x' = x, y' = -y, z' = -z, turned by 180 degrees about x. With the body's axes too,
/// forward-left-up becomes the autopilots' forward-right-down, and a world of north-west-up their
/// north-east-down.
enum class UpAxis { kZ, kY, kDown };
/// What is rotated: only the world axes (q' = F q), or the body's axes too (q' = F q F*).
enum class AxesScope { kWorld, kWorldAndBody };

[[nodiscard]] constexpr std::string_view name_of(UpAxis up) {
  return up == UpAxis::kDown ? "z-down" : up == UpAxis::kY ? "y-up" : "z-up";
}

/// Axes and units of one client. They are converted here and nowhere else.
struct OutputAxes {
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  double units_per_m{1.0};  ///< 1 metres, 1000 millimetres.

  bool operator==(const OutputAxes&) const = default;
};

/// The pose, velocity, rate, acceleration and covariance in the client's axes and units.
/// State, stamps and counters are copied.
[[nodiscard]] BodyPose to_client(const BodyPose& body, const OutputAxes& axes);

/// The same conversion per quantity, for wires that carry only some of them. C: the client's world
/// axes; P': the client's body axes (P, or P rotated like the world).
class AxesChange final {
 public:
  explicit AxesChange(const OutputAxes& axes);

  [[nodiscard]] Pose pose(const Pose& X_WP) const;  ///< X_CP', p in client units.
  /// Point, velocity or acceleration.
  [[nodiscard]] Eigen::Vector3d length(const Eigen::Vector3d& v_W) const;
  [[nodiscard]] Eigen::Vector3d world_rate(const Eigen::Vector3d& w_W) const;  ///< W → C axes.
  [[nodiscard]] Eigen::Vector3d body_rate(const Eigen::Vector3d& w_P) const;   ///< P → P' axes.
  /// Blocks as in BodyPose::covariance.
  [[nodiscard]] Matrix12d covariance(const Matrix12d& P) const;

 private:
  Eigen::Matrix3d R_CW_;
  Eigen::Quaterniond q_CW_;
  bool turns_world_;
  bool turns_body_;
  double units_per_m_;
};

/// The world axes N of an autopilot. Its body axes are always F: x forward, y right, z down.
enum class AutopilotWorld {
  kNed,  ///< North, east, down. W is taken as east, north, up (REP-103): x' = y, y' = x, z' = −z.
  kFrd,  ///< Heading unknown to the compass: x' = x, y' = −y, z' = −z.
};

namespace words {

inline constexpr std::array<Word<UpAxis>, 3> kUpAxis{
    {{"z", UpAxis::kZ}, {"y", UpAxis::kY}, {"down", UpAxis::kDown}}};
inline constexpr std::array<Word<AxesScope>, 2> kAxesScope{
    {{"world", AxesScope::kWorld}, {"world-and-body", AxesScope::kWorldAndBody}}};
inline constexpr std::array<Word<AutopilotWorld>, 2> kAutopilotWorld{
    {{"ned", AutopilotWorld::kNed}, {"frd", AutopilotWorld::kFrd}}};

}  // namespace words

/// A body's pivot in the axes of PX4 and ArduPilot. P is taken as x forward, y left, z up.
struct AutopilotOdometry {
  Eigen::Vector3d p_NF;     ///< m, N.
  Eigen::Quaterniond q_NF;  ///< Turns F vectors into N vectors.
  Eigen::Vector3d v_NF;     ///< m/s, N.
  Eigen::Vector3d v_NF_F;   ///< m/s, F.
  Eigen::Vector3d w_NF_F;   ///< rad/s, F.
  /// x, y, z (N), roll, pitch, yaw: small angles about the axes of the heading (N rotated by the
  /// yaw). Exact while the body is level; bounded also where the three angles are singular.
  Matrix6d pose_covariance;
  Matrix6d twist_covariance;  ///< Velocity (F) with the attitude's uncertainty, body rate (F).
  Eigen::Vector3d velocity_variance;  ///< (m/s)², N.
};

[[nodiscard]] AutopilotOdometry to_autopilot(const BodyPose& body, AutopilotWorld world);

/// Roll, pitch, yaw of q_NF: turns about x, then y, then z of N. Pitch in [−π/2, π/2].
[[nodiscard]] Eigen::Vector3d roll_pitch_yaw(const Eigen::Quaterniond& q_NF);

/// Angles about x, y and z with R = Rx(a1) · Ry(a2) · Rz(a3), radians; a2 within ±pi/2. Within
/// 1e-9 rad of there a3 is 0.
[[nodiscard]] Eigen::Vector3d xyz_angles(const Eigen::Matrix3d& R);

/// Covariance of v_P (with the attitude's uncertainty) and w_P, in body axes P.
[[nodiscard]] Matrix6d body_twist_covariance(const BodyPose& body);

/// 1..100 while the pose is valid, else −1. 100 at 1 cm and 1 degree or better, less by the worse
/// of the two; at most 50 while no tag is seen.
[[nodiscard]] std::int8_t autopilot_quality(const BodyPose& body);

}  // namespace fiducap
