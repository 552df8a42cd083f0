#include "streaming/dds/ros_messages.hpp"

#include <algorithm>

namespace fiducap::dds {

namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;

template <typename Matrix, std::size_t N>
void put_rows(const Matrix& from, double (&to)[N]) {
  static_assert(N == Matrix::RowsAtCompileTime * Matrix::ColsAtCompileTime);
  Eigen::Map<
      Eigen::Matrix<double, Matrix::RowsAtCompileTime, Matrix::ColsAtCompileTime, Eigen::RowMajor>>
      view(to);
  view = from;
}

template <typename T>
void put(const Eigen::Vector3d& from, T (&to)[3]) {
  for (int i = 0; i < 3; ++i) to[i] = static_cast<T>(from[i]);
}

template <typename T>
void put(const Eigen::Quaterniond& from, T (&to)[4]) {
  to[0] = static_cast<T>(from.w());
  to[1] = static_cast<T>(from.x());
  to[2] = static_cast<T>(from.y());
  to[3] = static_cast<T>(from.z());
}

fiducap_dds_BodyState to_dds(BodyState state) {
  switch (state) {
    case BodyState::kSearching:
      return fiducap_dds_SEARCHING;
    case BodyState::kTracking:
      return fiducap_dds_TRACKING;
    case BodyState::kCoasting:
      return fiducap_dds_COASTING;
    case BodyState::kLost:
      return fiducap_dds_LOST;
  }
  return fiducap_dds_LOST;
}

fiducap_dds_TagState to_dds(TagState state) {
  switch (state) {
    case TagState::kLocal:
      return fiducap_dds_LOCAL;
    case TagState::kCalibrated:
      return fiducap_dds_CALIBRATED;
    case TagState::kSurveyed:
      return fiducap_dds_SURVEYED;
    case TagState::kQuarantined:
      return fiducap_dds_QUARANTINED;
  }
  return fiducap_dds_QUARANTINED;
}

}  // namespace

builtin_interfaces_msg_dds__Time_ to_ros(std::int64_t utc_ns) {
  const std::int64_t ns = std::max<std::int64_t>(utc_ns, 0);
  return {static_cast<std::int32_t>(ns / kNsPerSecond),
          static_cast<std::uint32_t>(ns % kNsPerSecond)};
}

geometry_msgs_msg_dds__Vector3_ to_ros(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

geometry_msgs_msg_dds__Pose_ to_ros(const Pose& X) {
  return {{X.p.x(), X.p.y(), X.p.z()}, {X.q.x(), X.q.y(), X.q.z(), X.q.w()}};
}

geometry_msgs_msg_dds__Transform_ to_ros_transform(const Pose& X) {
  return {to_ros(X.p), {X.q.x(), X.q.y(), X.q.z(), X.q.w()}};
}

void fill(geometry_msgs_msg_dds__PoseStamped_& out, const BodyPose& body) {
  out.pose = to_ros(body.X_WP);
}

void fill(geometry_msgs_msg_dds__TwistStamped_& out, const BodyPose& body) {
  out.twist = {to_ros(body.v_WP), to_ros(Eigen::Vector3d(body.X_WP.q * body.w_WP_P))};
}

void fill(nav_msgs_msg_dds__Odometry_& out, const BodyPose& body) {
  out.pose.pose = to_ros(body.X_WP);
  put_rows(Matrix6d(body.covariance.topLeftCorner<6, 6>()), out.pose.covariance);
  out.twist.twist = {to_ros(Eigen::Vector3d(body.X_WP.q.conjugate() * body.v_WP)),
                     to_ros(body.w_WP_P)};
  put_rows(body_twist_covariance(body), out.twist.covariance);
}

void fill(px4_msgs_msg_dds__VehicleOdometry_& out, const BodyPose& body, std::int64_t utc_ns,
          AutopilotWorld world, std::uint32_t jumps) {
  const AutopilotOdometry told = to_autopilot(body, world);
  const std::uint8_t axes = world == AutopilotWorld::kNed ? 1 : 2;
  out.timestamp = out.timestamp_sample =
      static_cast<std::uint64_t>(std::max<std::int64_t>(utc_ns, 0) / 1000);
  out.pose_frame = out.velocity_frame = axes;
  put(told.p_NF, out.position);
  put(told.q_NF, out.q);
  put(told.v_NF, out.velocity);
  put(told.w_NF_F, out.angular_velocity);
  put(Eigen::Vector3d(told.pose_covariance.diagonal().head<3>()), out.position_variance);
  put(Eigen::Vector3d(told.pose_covariance.diagonal().tail<3>()), out.orientation_variance);
  put(told.velocity_variance, out.velocity_variance);
  out.reset_counter = static_cast<std::uint8_t>(jumps);
  out.quality = autopilot_quality(body);
}

void fill(fiducap_dds_Body& out, const BodyPose& body, const SceneFrame& frame,
          std::uint32_t jumps) {
  out.id = body.body_id;
  out.frame = frame.number;
  out.utc_ns = frame.utc_ns();
  const bool seen = body.exposed_at != Instant{};
  out.exposed_utc_ns = seen ? to_ns(body.exposed_at) + frame.utc_offset.count() : 0;
  out.state = to_dds(body.state);
  out.valid = body.valid;
  out.tags_in_view = static_cast<std::uint32_t>(std::max(body.tags_in_view, 0));
  out.reset_counter = jumps;
  out.age_s = to_seconds(body.age);
  put(body.X_WP.p, out.position);
  put(body.X_WP.q, out.attitude);
  put(body.v_WP, out.velocity);
  put(body.w_WP_P, out.body_rate);
  put(body.a_WP, out.acceleration);
  put_rows(body.covariance, out.covariance);
}

void fill(fiducap_dds_Tag& out, const MapTag& tag, std::int64_t map_version) {
  out.id = tag.tag.tag_id;
  out.edge_m = tag.tag.edge_m;
  out.state = to_dds(tag.state);
  out.map_version = static_cast<std::uint64_t>(std::max<std::int64_t>(map_version, 0));
  put(tag.tag.X_WT.p, out.position);
  put(tag.tag.X_WT.q, out.attitude);
  put_rows(tag.tag.covariance, out.covariance);
}

bool is_usable(const BodyPose& body) {
  return body.valid && body.X_WP.p.allFinite() && body.X_WP.q.coeffs().allFinite() &&
         body.v_WP.allFinite() && body.w_WP_P.allFinite() && body.a_WP.allFinite() &&
         body.covariance.allFinite();
}

}  // namespace fiducap::dds
