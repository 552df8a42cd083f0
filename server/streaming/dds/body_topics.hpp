#pragma once

#include <functional>
#include <optional>
#include <string>

#include "streaming/conventions/send_schedule.hpp"
#include "streaming/dds/ros_messages.hpp"
#include "streaming/dds/topic_set.hpp"

namespace fiducap::dds {

/// The topics of one body. Silent while its pose may not be used: ROS has no word for that in these
/// types.
class BodyTopics final {
 public:
  /// @param name  as a ROS name   @param alone  the server has no other body
  BodyTopics(TopicMaker& make, std::string name, bool alone);

  /// @param body  usable
  void publish(const SceneFrame& frame, const BodyPose& body, std::uint32_t jumps);
  void each(const std::function<void(const Writer&)>& visit) const;

 private:
  void publish_px4(const SceneFrame& frame, const BodyPose& body, std::uint32_t jumps);

  std::string name_;
  std::string world_frame_;
  AutopilotWorld px4_world_;
  SendSchedule px4_schedule_;
  std::optional<Writer> pose_;
  std::optional<Writer> twist_;
  std::optional<Writer> odometry_;
  std::optional<Writer> px4_;
};

}  // namespace fiducap::dds
