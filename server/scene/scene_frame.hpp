#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "mapping/tag_map.hpp"

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

/// What does not change from frame to frame about a body.
struct BodyDescription {
  int id{};          ///< Streaming id, 1..; stable.
  std::string name;  ///< As in the configuration.
};

/// The bodies a client can ask for. A new generation is published when the list changes.
struct SceneModel {
  std::uint64_t generation{1};
  std::vector<BodyDescription> bodies;
};

/// One body in one frame. Everything is about its pivot P.
struct BodyPose {
  int body_id{};
  BodyState state{BodyState::kSearching};
  bool valid{};  ///< The pose may be used. False: pose and twist below are history.
  Pose X_WP;
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

/// All bodies at one instant. Immutable once published, shared by all protocols.
struct SceneFrame {
  std::uint64_t number{};  ///< Counts up by 1 from the start of the server.
  Instant at{};            ///< The instant the poses are *for*.
  Instant published_at{};  ///< When this frame was made.
  Duration utc_offset{};   ///< UTC = server time + utc_offset.
  double rate_hz{};
  std::vector<BodyPose> bodies;  ///< Order of model->bodies.
  std::shared_ptr<const SceneModel> model;
  std::shared_ptr<const TagMap> map;

  [[nodiscard]] std::int64_t utc_ns() const { return to_ns(at) + utc_offset.count(); }
};

}  // namespace fiducap
