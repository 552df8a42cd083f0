#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <fiducap_dds/fiducap.h>
#include <fiducap_dds/ros_geometry.h>
#include <fiducap_dds/ros_mocap.h>

#include "middleware/endpoints.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"

/// ROS names and types (descriptor, hash), and bodies as structs of DDS types; pure. A ROS topic
/// `/a/b` is `rt/a/b` on the wire. Texts are borrowed: they must outlive the message.
namespace fiducap::dds {

/// A valid part of a topic's name: a letter, then letters, digits, single underscores.
[[nodiscard]] bool is_ros_name(std::string_view name);
/// `/a` or `/a/b`.
[[nodiscard]] bool is_ros_namespace(std::string_view name);
/// For tf2: not empty, no leading slash, no special characters.
[[nodiscard]] bool is_ros_frame(std::string_view name);

/// The bodies' names in ROS, in their order: by the conventions, starting with a letter; distinct.
[[nodiscard]] std::vector<std::string> ros_names(const SceneModel& model,
                                                 const NameAliases& aliases = {});

enum class RosType {
  kPoseStamped,
  kTwistStamped,
  kOdometry,
  kTfMessage,
  kNamedPoseArray,
  kRigidBodies,
  kDiagnosticArray,
  kVehicleOdometry,
};

/// @param topic  in ROS: `/tf`
[[nodiscard]] TopicName ros_topic(const std::string& topic, RosType type);

[[nodiscard]] builtin_interfaces_msg_dds__Time_ to_ros(std::int64_t utc_ns);
[[nodiscard]] geometry_msgs_msg_dds__Pose_ to_ros(const Pose& X);
[[nodiscard]] geometry_msgs_msg_dds__Transform_ to_ros_transform(const Pose& X);
[[nodiscard]] geometry_msgs_msg_dds__Vector3_ to_ros(const Eigen::Vector3d& v);
/// The middleware only reads, but its structs are not const.
[[nodiscard]] inline char* borrowed(const std::string& text) {
  return const_cast<char*>(text.c_str());
}

/// A sequence of the middleware over our memory, which it does not release.
template <typename Sequence, typename T>
void lend(Sequence& to, std::vector<T>& from) {
  to._length = to._maximum = static_cast<std::uint32_t>(from.size());
  to._buffer = from.data();
  to._release = false;
}

/// Pose in W.
void fill(geometry_msgs_msg_dds__PoseStamped_& out, const BodyPose& body);
/// Velocity and angular rate of the body, both in W axes.
void fill(geometry_msgs_msg_dds__TwistStamped_& out, const BodyPose& body);
/// Pose in W, twist in the body's axes P, each with its covariance.
void fill(nav_msgs_msg_dds__Odometry_& out, const BodyPose& body);
/// Velocity in the same axes as the pose. Times are UTC; the bridge converts them to PX4's.
void fill(px4_msgs_msg_dds__VehicleOdometry_& out, const BodyPose& body, std::int64_t utc_ns,
          AutopilotWorld world, std::uint32_t jumps);
void fill(fiducap_dds_Body& out, const BodyPose& body, const SceneFrame& frame,
          std::uint32_t jumps);
void fill(fiducap_dds_Tag& out, const MapTag& tag, std::int64_t map_version);

/// @return valid, and all numbers are finite
[[nodiscard]] bool is_usable(const BodyPose& body);

}  // namespace fiducap::dds
