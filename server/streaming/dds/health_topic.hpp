#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "streaming/conventions/send_schedule.hpp"
#include "streaming/dds/ros_messages.hpp"
#include "streaming/dds/topic_set.hpp"

namespace fiducap::dds {

/// `/diagnostics`, once a second: how each body is, as rqt_robot_monitor shows it.
class HealthTopic final {
 public:
  explicit HealthTopic(TopicMaker& make);

  void use(const SceneModel& model);
  void publish(const SceneFrame& frame);
  void each(const std::function<void(const Writer&)>& visit) const;

 private:
  static constexpr std::size_t kValues = 6;
  using Text = std::array<char, 48>;  ///< Ends with a zero.
  struct Body {
    std::string name;  ///< `fiducap: drone`
    Text message{};
    std::array<Text, kValues> values{};
    std::array<diagnostic_msgs_msg_dds__KeyValue_, kValues> pairs{};
  };
  static void tell(Body& out, const BodyPose& body);

  std::string empty_;
  std::vector<Body> bodies_;
  std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> statuses_;
  SendSchedule schedule_{1.0};
  std::optional<Writer> writer_;
};

}  // namespace fiducap::dds
