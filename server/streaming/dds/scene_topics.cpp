#include "streaming/dds/scene_topics.hpp"

#include <algorithm>

#include "streaming/dds/ros_types.hpp"

namespace fiducap::dds {

namespace {

Qos with_deadline(Qos qos, double rate_hz) {
  if (rate_hz > 0) qos.deadline_s = 1 / rate_hz;
  return qos;
}

/// A sequence of the middleware over our memory: it reads it and lets it be.
template <typename Sequence, typename T>
void lend(Sequence& to, std::vector<T>& from) {
  to._length = to._maximum = static_cast<std::uint32_t>(from.size());
  to._buffer = from.data();
  to._release = false;
}

std_msgs_msg_dds__Header_ header_of(const SceneFrame& frame, const std::string& world_frame) {
  return {to_ros(frame.utc_ns()), borrowed(world_frame)};
}

}  // namespace

SceneTopics::SceneTopics(TopicMaker& make) : world_frame_(make.config().world_frame) {
  const DdsConfig& config = make.config();
  const Qos stream = make.stream();
  // tf2 listens with "reliable": nothing else would be heard.
  tf_ = make.make(config.tf, ros_topic("/tf", RosType::kTfMessage), {true, false, 1, 0});
  poses_ = make.make(config.poses, ros_topic("/poses", RosType::kNamedPoseArray),
                     with_deadline(stream, config.poses_deadline_hz));
  rigid_bodies_ =
      make.make(config.rigid_bodies, ros_topic("/rigid_bodies", RosType::kRigidBodies), stream);
  native_ = make.make(config.native, {"fiducap/bodies", &fiducap_dds_Body_desc, {}}, stream);
}

void SceneTopics::use(const SceneModel& model, std::vector<std::string> names) {
  for (const auto& old : bodies_) {
    const auto same = [&old](const BodyDescription& body) { return body.id == old.id; };
    if (!native_ || std::any_of(model.bodies.begin(), model.bodies.end(), same)) continue;
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

// Also without a body: the deadline is a promise about messages.
void SceneTopics::publish_poses(const SceneFrame& frame, const std::vector<bool>& usable) {
  named_poses_.clear();
  for (std::size_t i = 0; i < frame.bodies.size(); ++i) {
    if (usable[i]) named_poses_.push_back({borrowed(names_[i]), to_ros(frame.bodies[i].X_WP)});
  }
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

void SceneTopics::each(const std::function<void(const Writer&)>& visit) const {
  for (const auto* writer : {&tf_, &poses_, &rigid_bodies_, &native_}) {
    if (*writer) visit(**writer);
  }
}

}  // namespace fiducap::dds
