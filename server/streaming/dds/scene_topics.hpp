#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "streaming/dds/ros_messages.hpp"
#include "streaming/dds/topic_set.hpp"

namespace fiducap::dds {

/// The topics that hold all usable bodies in one message: `/tf`, `/poses`, `/rigid_bodies`, and
/// `fiducap/bodies`, which has one instance per body and says of every body how it is.
///
/// Keeps its messages: after the first frame of a model nothing is allocated here.
class SceneTopics final {
 public:
  explicit SceneTopics(TopicMaker& make);

  /// Those who left the model are disposed of. @param names  of the bodies, as ROS names, in their
  /// order
  void use(const SceneModel& model, std::vector<std::string> names);
  /// @param usable  per body of the frame
  void publish(const SceneFrame& frame, const std::vector<bool>& usable,
               const std::vector<std::uint32_t>& jumps);
  void each(const std::function<void(const Writer&)>& visit) const;

 private:
  void publish_tf(const SceneFrame& frame, const std::vector<bool>& usable);
  void publish_poses(const SceneFrame& frame, const std::vector<bool>& usable);
  void publish_rigid_bodies(const SceneFrame& frame, const std::vector<bool>& usable);
  void publish_native(const SceneFrame& frame, const std::vector<std::uint32_t>& jumps);

  std::string world_frame_;
  std::vector<std::string> names_;
  std::vector<BodyDescription> bodies_;  ///< With their own names, for the native type.
  std::vector<geometry_msgs_msg_dds__TransformStamped_> transforms_;
  std::vector<motion_capture_tracking_interfaces_msg_dds__NamedPose_> named_poses_;
  std::vector<mocap4r2_msgs_msg_dds__RigidBody_> rigid_;
  std::optional<Writer> tf_;
  std::optional<Writer> poses_;
  std::optional<Writer> rigid_bodies_;
  std::optional<Writer> native_;
};

}  // namespace fiducap::dds
