#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/body_estimate.hpp"

namespace fiducap {

using Matrix12d = Eigen::Matrix<double, 12, 12>;

enum class BodyState {
  kSearching,  ///< No tag yet, or none that ties the body to the workspace.
  kTracking,
  kCoasting,  ///< IMU (or motion model) only; sigma grows.
  kLost,
};

[[nodiscard]] constexpr std::string_view name_of(BodyState state) {
  constexpr std::array<std::string_view, 4> kNames{"searching", "tracking", "coasting", "lost"};
  return kNames.at(static_cast<std::size_t>(state));
}

/// One body in one frame. All quantities are of its pivot P.
struct BodyPose {
  int body_id{};
  BodyState state{BodyState::kSearching};
  bool valid{};  ///< The pose may be used. False: pose and twist below are history.
  Pose X_WP{};
  Eigen::Vector3d v_WP{Eigen::Vector3d::Zero()};    ///< m/s, W axes.
  Eigen::Vector3d w_WP_P{Eigen::Vector3d::Zero()};  ///< rad/s, P axes.
  Eigen::Vector3d a_WP{Eigen::Vector3d::Zero()};    ///< m/s², W axes, 0 at rest; see write_pivot.
  /// Position (W), attitude (rotation vector, W), velocity (W), body rate (P).
  Matrix12d covariance{Matrix12d::Zero()};
  Instant exposed_at{};  ///< Newest image in the estimate.
  Duration age{};  ///< frame.at − exposed_at of the last image with a used tag; 0: there was none.
  int tags_in_view{};  ///< Used in the newest image; 0 unless tracking.
  double image_rate_hz{};
  double reprojection_px{};
  Duration processing{};  ///< Arrival of the newest image → its update done.
  std::uint64_t images_dropped{};

  /// Root of the largest position variance (axis-wise).
  [[nodiscard]] double position_sigma_m() const;
  [[nodiscard]] double rotation_sigma_rad() const;
};

/// Transforms the state of a body from its IMU axes B to its pivot P: pose, twist, acceleration and
/// covariance.
///
/// The lever arm p_BP turns body rate into velocity and centripetal acceleration. Angular
/// acceleration × arm is left out: no sensor measures it, and differentiated gyro noise would
/// dominate it.
/// @param rate_variance  (rad/s)² per axis: noise of the body rate beyond its bias, independent of
/// the state
/// @param out  X_WP v_WP w_WP_P a_WP covariance are written, nothing else
void write_pivot(const BodyEstimate& body, const Pose& X_BP, double rate_variance, BodyPose& out);

}  // namespace fiducap
