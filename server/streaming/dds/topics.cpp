#include "streaming/dds/topics.hpp"

#include <algorithm>
#include <chrono>

namespace fiducap::dds {

namespace {

std_msgs_msg_dds__Header_ header_of(const SceneFrame& frame, const std::string& world_frame) {
  return {to_ros(frame.utc_ns()), borrowed(world_frame)};
}

constexpr Duration kMapPeriod = std::chrono::seconds(1);

bool is_settled(const MapTag& tag) {
  return tag.component == 0 &&
         (tag.state == TagState::kCalibrated || tag.state == TagState::kSurveyed);
}

}  // namespace

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
  // As in PX4: several vehicles have a namespace each, a single one has none.
  px4_ = make.make(config.px4 != Px4Profile::kOff,
                   ros_topic((alone ? "" : "/" + name_) + "/fmu/in/vehicle_visual_odometry",
                             RosType::kVehicleOdometry),
                   stream);
}

void BodyTopics::publish(const SceneFrame& frame, const BodyPose& body, std::uint32_t jumps) {
  const auto send_stamped = [&](std::optional<Writer>& writer, auto message) {
    message.header = header_of(frame, world_frame_);
    fill(message, body);
    send(writer, &message);
  };
  if (is_wanted(pose_)) send_stamped(pose_, geometry_msgs_msg_dds__PoseStamped_{});
  if (is_wanted(twist_)) send_stamped(twist_, geometry_msgs_msg_dds__TwistStamped_{});
  if (is_wanted(odometry_)) {
    nav_msgs_msg_dds__Odometry_ message{};
    message.child_frame_id = borrowed(name_);
    send_stamped(odometry_, message);
  }
  if (!is_wanted(px4_) || !px4_schedule_.is_due(frame.at, frame.rate_hz)) return;
  px4_msgs_msg_dds__VehicleOdometry_ message;
  fill(message, body, frame.utc_ns(), px4_world_, jumps);
  send(px4_, &message);
}

SceneTopics::SceneTopics(TopicMaker& make) : world_frame_(make.config().world_frame) {
  const DdsConfig& config = make.config();
  const Qos stream = make.stream();
  Qos with_deadline = stream;
  if (config.poses_deadline_hz > 0) with_deadline.deadline_s = 1 / config.poses_deadline_hz;
  // tf2 subscribes as reliable.
  tf_ = make.make(config.tf, ros_topic("/tf", RosType::kTfMessage), {true, false, 1, 0});
  poses_ = make.make(config.poses, ros_topic("/poses", RosType::kNamedPoseArray), with_deadline);
  rigid_bodies_ =
      make.make(config.rigid_bodies, ros_topic("/rigid_bodies", RosType::kRigidBodies), stream);
  native_ = make.make(config.native, {"fiducap/bodies", &fiducap_dds_Body_desc, {}}, stream);
}

void SceneTopics::use(const SceneModel& model, std::vector<std::string> names) {
  for (const auto& old : bodies_) {
    const auto same = [&old](const BodyDescription& body) { return body.id == old.id; };
    if (!native_ || std::ranges::any_of(model.bodies, same)) continue;
    fiducap_dds_Body gone{};
    gone.id = old.id;
    gone.name = borrowed(old.name);
    native_->dispose(&gone);
    native_->flush();
  }
  bodies_ = model.bodies;
  names_ = std::move(names);
  transforms_.reserve(names_.size());
  named_poses_.reserve(names_.size());
  rigid_.reserve(names_.size());
}

void SceneTopics::publish(const SceneFrame& frame, const std::vector<bool>& usable,
                          const std::vector<std::uint32_t>& jumps) {
  if (is_wanted(tf_)) publish_tf(frame, usable);
  if (is_wanted(poses_)) publish_poses(frame, usable);
  if (is_wanted(rigid_bodies_)) publish_rigid_bodies(frame, usable);
  if (is_wanted(native_)) publish_native(frame, jumps);
}

void SceneTopics::publish_tf(const SceneFrame& frame, const std::vector<bool>& usable) {
  transforms_.clear();
  const auto header = header_of(frame, world_frame_);
  for (std::size_t i = 0; i < frame.bodies.size(); ++i) {
    if (usable[i])
      transforms_.push_back({header, borrowed(names_[i]), to_ros_transform(frame.bodies[i].X_WP)});
  }
  if (transforms_.empty()) return;
  tf2_msgs_msg_dds__TFMessage_ message;
  lend(message.transforms, transforms_);
  send(tf_, &message);
}

// Also without bodies, because of the deadline.
void SceneTopics::publish_poses(const SceneFrame& frame, const std::vector<bool>& usable) {
  named_poses_.clear();
  for (std::size_t i = 0; i < frame.bodies.size(); ++i)
    if (usable[i]) named_poses_.push_back({borrowed(names_[i]), to_ros(frame.bodies[i].X_WP)});
  motion_capture_tracking_interfaces_msg_dds__NamedPoseArray_ message;
  message.header = header_of(frame, world_frame_);
  lend(message.poses, named_poses_);
  send(poses_, &message);
}

void SceneTopics::publish_rigid_bodies(const SceneFrame& frame, const std::vector<bool>& usable) {
  rigid_.clear();
  for (std::size_t i = 0; i < frame.bodies.size(); ++i) {
    if (!usable[i]) continue;
    rigid_.push_back({borrowed(names_[i]), {0, 0, nullptr, false}, to_ros(frame.bodies[i].X_WP)});
  }
  mocap4r2_msgs_msg_dds__RigidBodies_ message;
  message.header = header_of(frame, world_frame_);
  message.frame_number = static_cast<std::uint32_t>(frame.number);
  lend(message.rigidbodies, rigid_);
  send(rigid_bodies_, &message);
}

void SceneTopics::publish_native(const SceneFrame& frame, const std::vector<std::uint32_t>& jumps) {
  fiducap_dds_Body message;
  for (std::size_t i = 0; i < frame.bodies.size(); ++i) {
    fill(message, frame.bodies[i], frame, jumps[i]);
    message.valid = message.valid && is_usable(frame.bodies[i]);
    message.name = borrowed(bodies_[i].name);
    native_->write(&message);
  }
  native_->flush();
}

MapTopics::MapTopics(TopicMaker& make) : world_frame_(make.config().world_frame) {
  const DdsConfig& config = make.config();
  tf_static_ =
      make.make(config.tf, ros_topic("/tf_static", RosType::kTfMessage), TopicMaker::kept());
  tags_ = make.make(config.native, {"fiducap/tags", &fiducap_dds_Tag_desc, {}}, TopicMaker::kept());
}

void MapTopics::publish(const SceneFrame& frame) {
  if (frame.map == sent_ || !frame.map) return;
  if (sent_at_ && frame.at - *sent_at_ < kMapPeriod) return;
  if (tf_static_) publish_tf(frame);
  if (tags_) publish_tags(*frame.map);
  sent_ = frame.map;
  sent_at_ = frame.at;
}

void MapTopics::publish_tf(const SceneFrame& frame) {
  std::vector<std::pair<int, Pose>> settled;
  std::vector<std::string> names;
  for (const auto& tag : frame.map->tags) {
    if (!is_settled(tag)) continue;
    settled.emplace_back(tag.tag.tag_id, tag.tag.X_WT);
    names.push_back("tag_" + std::to_string(tag.tag.tag_id));
  }
  const auto same = [](const auto& a, const auto& b) {
    return a.first == b.first && a.second.p == b.second.p &&
           a.second.q.coeffs() == b.second.q.coeffs();
  };
  // tf2 cannot remove frames: an empty set is not sent.
  if (settled.empty() ||
      std::equal(settled.begin(), settled.end(), sent_tf_.begin(), sent_tf_.end(), same)) {
    return;
  }
  const auto header = header_of(frame, world_frame_);
  std::vector<geometry_msgs_msg_dds__TransformStamped_> transforms;
  for (std::size_t i = 0; i < settled.size(); ++i)
    transforms.push_back({header, borrowed(names[i]), to_ros_transform(settled[i].second)});
  tf2_msgs_msg_dds__TFMessage_ message{};
  lend(message.transforms, transforms);
  send(tf_static_, &message);
  sent_tf_ = std::move(settled);
}

void MapTopics::publish_tags(const TagMap& map) {
  fiducap_dds_Tag message{};
  for (const int id : sent_ids_) {
    if (map.find(id) != nullptr) continue;
    message.id = id;
    tags_->dispose(&message);
  }
  sent_ids_.clear();
  for (const auto& tag : map.tags) {
    fill(message, tag, map.version);
    tags_->write(&message);
    sent_ids_.push_back(tag.tag.tag_id);
  }
  tags_->flush();
}

}  // namespace fiducap::dds
