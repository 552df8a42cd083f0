#include "streaming/dds/ros_types.hpp"

#include <fiducap_dds/ros_geometry.h>
#include <fiducap_dds/ros_mocap.h>

namespace fiducap::dds {

namespace {

struct Known {
  const dds_topic_descriptor* type;
  const char* hash;  ///< RIHS01 (REP-2011): SHA-256 over the type's description as JSON.
};

Known known(RosType type) {
  switch (type) {
    case RosType::kPoseStamped:
      return {&geometry_msgs_msg_dds__PoseStamped__desc,
              "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"};
    case RosType::kTwistStamped:
      return {&geometry_msgs_msg_dds__TwistStamped__desc,
              "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"};
    case RosType::kOdometry:
      return {&nav_msgs_msg_dds__Odometry__desc,
              "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"};
    case RosType::kTfMessage:
      return {&tf2_msgs_msg_dds__TFMessage__desc,
              "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"};
    case RosType::kNamedPoseArray:
      return {&motion_capture_tracking_interfaces_msg_dds__NamedPoseArray__desc,
              "d4c89ff7e0670d5f83b0322513e1c8dc2c3b279a68495daa026c352f0027e5f2"};
    case RosType::kRigidBodies:
      return {&mocap4r2_msgs_msg_dds__RigidBodies__desc,
              "1f2d74f2a1706c59639a2349b7be91e9e4d751fad6fc3048c59d8f1f0576ea70"};
    case RosType::kDiagnosticArray:
      return {&diagnostic_msgs_msg_dds__DiagnosticArray__desc,
              "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"};
    case RosType::kVehicleOdometry:
      return {&px4_msgs_msg_dds__VehicleOdometry__desc,
              "4295b96ad312084aa35c84bdcec65ba2f57eb4f6a293d57d52d95acbe99ff817"};
  }
  return {};
}

}  // namespace

TopicName ros_topic(const std::string& topic, RosType type) {
  const auto [descriptor, hash] = known(type);
  return {"rt" + topic, descriptor, std::string("RIHS01_") + hash};
}

}  // namespace fiducap::dds
