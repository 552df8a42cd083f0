#pragma once

#include "middleware/participant.hpp"

/// The ROS 2 messages that we write: descriptor and hash of each type. A ROS topic `/a/b` is
/// `rt/a/b` on the wire.
namespace fiducap::dds {

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

/// @param topic  as ROS users know it: `/tf`
[[nodiscard]] TopicName ros_topic(const std::string& topic, RosType type);

}  // namespace fiducap::dds
