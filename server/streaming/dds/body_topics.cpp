#include "streaming/dds/body_topics.hpp"

#include "streaming/dds/ros_types.hpp"

namespace fiducap::dds {

BodyTopics::BodyTopics(TopicMaker& make, std::string name, bool alone)
    : name_(std::move(name)),
      world_frame_(make.config().world_frame),
      px4_world_(make.config().px4 == Px4Profile::kNed ? AutopilotWorld::kNed
                                                       : AutopilotWorld::kFrd),
      px4_schedule_(make.config().px4_rate_hz) {
  const DdsConfig& config = make.config();
  const std::string own = config.prefix + "/" + name_;
  const Qos stream = make.stream();
  pose_ = make.make(config.pose, ros_topic(own + "/pose", RosType::kPoseStamped), stream);
  twist_ = make.make(config.twist, ros_topic(own + "/twist", RosType::kTwistStamped), stream);
  odometry_ = make.make(config.odometry, ros_topic(own + "/odom", RosType::kOdometry), stream);
  // Several vehicles have a namespace each, one has none: as PX4 itself does it.
  px4_ = make.make(config.px4 != Px4Profile::kOff,
                   ros_topic((alone ? "" : "/" + name_) + "/fmu/in/vehicle_visual_odometry",
                             RosType::kVehicleOdometry),
                   stream);
}

void BodyTopics::publish(const SceneFrame& frame, const BodyPose& body, std::uint32_t jumps) {
  const std_msgs_msg_dds__Header_ header{to_ros(frame.utc_ns()), borrowed(world_frame_)};
  if (is_wanted(pose_)) {
    geometry_msgs_msg_dds__PoseStamped_ message;
    message.header = header;
    fill(message, body);
    send(pose_, &message);
  }
  if (is_wanted(twist_)) {
    geometry_msgs_msg_dds__TwistStamped_ message;
    message.header = header;
    fill(message, body);
    send(twist_, &message);
  }
  if (is_wanted(odometry_)) {
    nav_msgs_msg_dds__Odometry_ message;
    message.header = header;
    message.child_frame_id = borrowed(name_);
    fill(message, body);
    send(odometry_, &message);
  }
  if (is_wanted(px4_)) publish_px4(frame, body, jumps);
}

void BodyTopics::publish_px4(const SceneFrame& frame, const BodyPose& body, std::uint32_t jumps) {
  if (!px4_schedule_.is_due(frame.at, frame.rate_hz)) return;
  px4_msgs_msg_dds__VehicleOdometry_ message;
  fill(message, body, frame.utc_ns(), px4_world_, jumps);
  send(px4_, &message);
}

void BodyTopics::each(const std::function<void(const Writer&)>& visit) const {
  for (const auto* writer : {&pose_, &twist_, &odometry_, &px4_}) {
    if (*writer) visit(**writer);
  }
}

}  // namespace fiducap::dds
