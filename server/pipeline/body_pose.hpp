#pragma once

#include <cstdint>
#include <string_view>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "base/time.hpp"

namespace fiducap {

using Matrix12d = Eigen::Matrix<double, 12, 12>;

enum class BodyState {
  kSearching,  ///< No tag seen yet, or none that ties the body to the workspace.
  kTracking,
  kCoasting,  ///< IMU (or motion model) only; sigma grows.
  kLost,
};

[[nodiscard]] constexpr std::string_view name_of(BodyState state) {
  switch (state) {
    case BodyState::kSearching:
      return "searching";
    case BodyState::kTracking:
      return "tracking";
    case BodyState::kCoasting:
      return "coasting";
    case BodyState::kLost:
      return "lost";
  }
  return "lost";
}

/// One body in one frame. Everything is about its pivot P.
struct BodyPose {
  int body_id{};
  BodyState state{BodyState::kSearching};
  bool valid{};  ///< The pose may be used. False: pose and twist below are history.
  Pose X_WP{};
  Eigen::Vector3d v_WP{Eigen::Vector3d::Zero()};    ///< m/s, W axes.
  Eigen::Vector3d w_WP_P{Eigen::Vector3d::Zero()};  ///< rad/s, P axes.
  Eigen::Vector3d a_WP{
      Eigen::Vector3d::Zero()};  ///< m/s², W axes, at rest 0 (pivot.hpp: what is left out).
  /// Position (W), attitude (rotation vector, W), velocity (W), body rate (P).
  Matrix12d covariance{Matrix12d::Zero()};
  Instant exposed_at{};  ///< Newest image in the estimate.
  Duration age{};  ///< frame.at − exposed_at of the last image with a used tag; 0: there was none.
  int tags_in_view{};  ///< Used in the newest image; 0 unless tracking.
  double image_rate_hz{};
  double reprojection_px{};
  Duration processing{};  ///< Arrival of the newest image → its update done.
  std::uint64_t images_dropped{};

  [[nodiscard]] double position_sigma_m()
      const;  ///< Root of the largest position variance (axis-wise).
  [[nodiscard]] double rotation_sigma_rad() const;
};

}  // namespace fiducap
