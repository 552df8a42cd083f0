#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/event_board.hpp"
#include "streaming/conventions/send_schedule.hpp"
#include "streaming/dds/ros_messages.hpp"
#include "streaming/dds/topic_set.hpp"

namespace fiducap::dds {

/// `/diagnostics`, as rqt_robot_monitor shows it: how each body is, and the server as a whole. What
/// stands on the event board is there with cause and remedy, a body's in its own status. Once a
/// second, and within a tenth of one when the board changes.
class HealthTopic final {
 public:
  /// @param events  nullptr: there is no board
  HealthTopic(TopicMaker& make, const EventBoard* events);

  void use(const SceneModel& model);
  void publish(const SceneFrame& frame);
  void each(const std::function<void(const Writer&)>& visit) const;

 private:
  static constexpr std::size_t kValues = 6;
  using KeyValue = diagnostic_msgs_msg_dds__KeyValue_;
  using Text = std::array<char, 48>;  ///< Ends with a zero.
  /// Of a body, or of the rest of the server.
  struct Part {
    std::string name;     ///< `fiducap: drone`
    std::string subject;  ///< On the board; empty: all that are no body's.
    Text message{};
    std::array<Text, kValues> numbers{};
    std::vector<KeyValue> values;
    std::vector<std::string> texts;  ///< What `values` point to beside the numbers.
    std::uint8_t alarm{};            ///< Level of the worst condition that stands.
    std::string worst;               ///< What it says.
  };
  bool look_at_board();
  void take_conditions(Part& part, const EventSheet::Events& standing) const;
  [[nodiscard]] bool is_of(const Part& part, const Event& event) const;
  void add_status(Part& part, std::uint8_t level);
  static void tell(Part& out, const BodyPose& body);

  const EventBoard* events_;
  std::shared_ptr<const EventSheet> sheet_;  ///< Of the board when it was looked at.
  std::string empty_;
  std::vector<Part> bodies_;
  Part server_;
  std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> statuses_;
  SendSchedule schedule_{1.0};
  SendSchedule look_{10.0};
  std::optional<Writer> writer_;
};

}  // namespace fiducap::dds
