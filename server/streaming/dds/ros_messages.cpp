#include "streaming/dds/ros_messages.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap::dds {

namespace {

constexpr std::size_t kLongestName = 100;

std::string as_ros_name(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const char put = is_letter(c) || is_digit(c) ? c : '_';
    if (put == '_' && !out.empty() && out.back() == '_') continue;
    out += put;
  }
  while (!out.empty() && out.back() == '_') out.pop_back();
  if (out.empty()) return "body";
  if (is_letter(out.front())) return out;
  return (out.front() == '_' ? "body" : "body_") + out;
}

/// Descriptor, and RIHS01 (REP-2011): SHA-256 over the type's description as JSON.
using KnownType = std::pair<const dds_topic_descriptor*, const char*>;

/// By RosType.
constexpr std::array<KnownType, 8> kKnownTypes{{
    {&geometry_msgs_msg_dds__PoseStamped__desc,
     "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"},
    {&geometry_msgs_msg_dds__TwistStamped__desc,
     "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"},
    {&nav_msgs_msg_dds__Odometry__desc,
     "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"},
    {&tf2_msgs_msg_dds__TFMessage__desc,
     "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"},
    {&motion_capture_tracking_interfaces_msg_dds__NamedPoseArray__desc,
     "d4c89ff7e0670d5f83b0322513e1c8dc2c3b279a68495daa026c352f0027e5f2"},
    {&mocap4r2_msgs_msg_dds__RigidBodies__desc,
     "1f2d74f2a1706c59639a2349b7be91e9e4d751fad6fc3048c59d8f1f0576ea70"},
    {&diagnostic_msgs_msg_dds__DiagnosticArray__desc,
     "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"},
    {&px4_msgs_msg_dds__VehicleOdometry__desc,
     "4295b96ad312084aa35c84bdcec65ba2f57eb4f6a293d57d52d95acbe99ff817"},
}};

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

static_assert(static_cast<int>(BodyState::kLost) == fiducap_dds_LOST);
static_assert(static_cast<int>(TagState::kQuarantined) == fiducap_dds_QUARANTINED);

}  // namespace

bool is_ros_name(std::string_view name) {
  return !name.empty() && name.size() <= kLongestName && is_letter(name.front()) &&
         name.find("__") == std::string_view::npos &&
         std::ranges::all_of(name, [](char c) { return is_letter(c) || is_digit(c) || c == '_'; });
}

bool is_ros_namespace(std::string_view name) {
  if (name.size() > 150) return false;
  while (!name.empty()) {
    if (name.front() != '/') return false;
    name.remove_prefix(1);
    const std::string_view part = name.substr(0, name.find('/'));
    if (!is_ros_name(part)) return false;
    name.remove_prefix(part.size());
  }
  return true;
}

bool is_ros_frame(std::string_view name) {
  const auto good = [](char c) {
    return is_letter(c) || is_digit(c) || c == '_' || c == '/' || c == '-' || c == '.';
  };
  return !name.empty() && name.size() <= 100 && name.front() != '/' &&
         std::ranges::all_of(name, good);
}

std::vector<std::string> ros_names(const SceneModel& model, const NameAliases& aliases) {
  std::vector<std::string> fit;
  for (const BodyDescription& body : model.bodies)
    fit.push_back(as_ros_name(client_name(body.name, conventions_of("ros2").names, aliases)));
  return make_distinct(model, aliases, fit, kLongestName);
}

static_assert(kKnownTypes.size() == static_cast<std::size_t>(RosType::kVehicleOdometry) + 1);
TopicName ros_topic(const std::string& topic, RosType type) {
  const auto [descriptor, hash] = kKnownTypes[static_cast<std::size_t>(type)];
  return {"rt" + topic, descriptor, std::string("RIHS01_") + hash};
}

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
  const AutopilotOdometry odometry = to_autopilot(body, world);
  const std::uint8_t axes = world == AutopilotWorld::kNed ? 1 : 2;
  out.timestamp = out.timestamp_sample =
      static_cast<std::uint64_t>(std::max<std::int64_t>(utc_ns, 0) / 1000);
  out.pose_frame = out.velocity_frame = axes;
  put(odometry.p_NF, out.position);
  put(odometry.q_NF, out.q);
  put(odometry.v_NF, out.velocity);
  put(odometry.w_NF_F, out.angular_velocity);
  put(Eigen::Vector3d(odometry.pose_covariance.diagonal().head<3>()), out.position_variance);
  put(Eigen::Vector3d(odometry.pose_covariance.diagonal().tail<3>()), out.orientation_variance);
  put(odometry.velocity_variance, out.velocity_variance);
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
  out.state = static_cast<fiducap_dds_BodyState>(body.state);
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
  out.state = static_cast<fiducap_dds_TagState>(tag.state);
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
