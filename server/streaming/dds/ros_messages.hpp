#pragma once

#include <fiducap_dds/fiducap.h>
#include <fiducap_dds/ros_geometry.h>
#include <fiducap_dds/ros_mocap.h>

#include <string>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/autopilot_axes.hpp"

/// A body as the structs of DDS types; pure. Texts are borrowed: what they point to outlives the
/// message.
namespace fiducap::dds {

[[nodiscard]] builtin_interfaces_msg_dds__Time_ to_ros(std::int64_t utc_ns);
[[nodiscard]] geometry_msgs_msg_dds__Pose_ to_ros(const Pose& X);
[[nodiscard]] geometry_msgs_msg_dds__Transform_ to_ros_transform(const Pose& X);
[[nodiscard]] geometry_msgs_msg_dds__Vector3_ to_ros(const Eigen::Vector3d& v);
/// The middleware only reads; its structs know no const.
[[nodiscard]] inline char* borrowed(const std::string& text) {
  return const_cast<char*>(text.c_str());
}

/// Pose in W.
void fill(geometry_msgs_msg_dds__PoseStamped_& out, const BodyPose& body);
/// Velocity and angular rate of the body, both in W axes.
void fill(geometry_msgs_msg_dds__TwistStamped_& out, const BodyPose& body);
/// Pose in W, twist in the body's axes P, each with its covariance.
void fill(nav_msgs_msg_dds__Odometry_& out, const BodyPose& body);
/// Velocity in the same axes as the pose. Times are UTC: the bridge to PX4 turns them into PX4's
/// own.
void fill(px4_msgs_msg_dds__VehicleOdometry_& out, const BodyPose& body, std::int64_t utc_ns,
          AutopilotWorld world, std::uint32_t jumps);
void fill(fiducap_dds_Body& out, const BodyPose& body, const SceneFrame& frame,
          std::uint32_t jumps);
void fill(fiducap_dds_Tag& out, const MapTag& tag, std::int64_t map_version);

/// Finite numbers only: what a subscriber would choke on never leaves.
[[nodiscard]] bool is_usable(const BodyPose& body);

}  // namespace fiducap::dds
