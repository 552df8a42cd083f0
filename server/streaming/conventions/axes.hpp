#pragma once

#include <array>
#include <string_view>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/config_check.hpp"
#include "base/pose.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// Which way is up for a client. Inside it is always z.
/// y-up: x' = x, y' = z, z' = -y, that is the axes of the world turned by -90 degrees about x.
/// z-down: x' = x, y' = -y, z' = -z, turned by 180 degrees about x. With the body's axes too,
/// forward-left-up becomes the autopilots' forward-right-down, and a world of north-west-up their
/// north-east-down.
enum class UpAxis { kZ, kY, kDown };
/// What turns with the world: only the world axes (q' = F q), or the body's own axes too (q' = F q
/// F*).
enum class AxesScope { kWorld, kWorldAndBody };

[[nodiscard]] constexpr std::string_view name_of(UpAxis up) {
  switch (up) {
    case UpAxis::kZ:
      return "z-up";
    case UpAxis::kY:
      return "y-up";
    case UpAxis::kDown:
      return "z-down";
  }
  return "z-up";
}

/// One client's conventions. Units, axes and quaternion order are changed here and nowhere else,
/// position + attitude + twist + covariance together.
struct OutputAxes {
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  double units_per_m{1.0};  ///< 1 metres, 1000 millimetres.
};

/// The pose, velocity, rate, acceleration and covariance in the client's axes and units.
/// State, stamps and counters are copied.
[[nodiscard]] BodyPose to_client(const BodyPose& body, const OutputAxes& axes);

/// The same change quantity by quantity, for wires that carry only some of them.
/// C are the client's world axes, P' the body axes as the client sees them (P, or P turned like the
/// world).
class AxesChange final {
 public:
  explicit AxesChange(const OutputAxes& axes);

  [[nodiscard]] Pose pose(const Pose& X_WP) const;  ///< X_CP', p in client units.
  [[nodiscard]] Eigen::Vector3d length(
      const Eigen::Vector3d& v_W) const;  ///< Point, velocity or acceleration.
  [[nodiscard]] Eigen::Vector3d world_rate(
      const Eigen::Vector3d& w_W) const;  ///< rad/s, W → C axes.
  [[nodiscard]] Eigen::Vector3d body_rate(
      const Eigen::Vector3d& w_P) const;  ///< rad/s, P → P' axes.
  /// Blocks as in BodyPose::covariance.
  [[nodiscard]] Matrix12d covariance(const Matrix12d& P) const;

 private:
  Eigen::Matrix3d R_CW_;
  Eigen::Quaterniond q_CW_;
  bool turns_world_;
  bool turns_body_;
  double units_per_m_;
};

namespace words {

inline constexpr std::array<Word<UpAxis>, 3> kUpAxis{
    {{"z", UpAxis::kZ}, {"y", UpAxis::kY}, {"down", UpAxis::kDown}}};
inline constexpr std::array<Word<AxesScope>, 2> kAxesScope{
    {{"world", AxesScope::kWorld}, {"world-and-body", AxesScope::kWorldAndBody}}};

}  // namespace words

}  // namespace fiducap
