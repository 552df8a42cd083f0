#pragma once

#include <array>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/event_board.hpp"
#include "middleware/endpoints.hpp"
#include "streaming/conventions/frame_sequence.hpp"
#include "streaming/dds/dds.hpp"
#include "streaming/dds/ros_messages.hpp"

namespace fiducap::dds {

/// Creates writers and keeps the first failure.
class TopicMaker final {
 public:
  TopicMaker(const Participant& in, const DdsConfig& config) : in_(in), config_(config) {}

  /// Forgets an earlier failure, for a new model.
  void begin() { failure_.reset(); }
  /// @return nullopt: not wanted, or an earlier one failed
  std::optional<Writer> make(bool wanted, const TopicName& topic, const Qos& qos) {
    if (!wanted || failure_) return std::nullopt;
    auto writer = Writer::make(in_, topic, qos);
    if (writer) return std::move(*writer);
    failure_ = writer.error();
    return std::nullopt;
  }
  /// For messages of every frame: the newest only.
  [[nodiscard]] Qos stream() const { return {config_.reliable, false, 1, 0}; }
  /// For rare messages: kept for late subscribers.
  [[nodiscard]] static Qos kept() { return {true, true, 1, 0}; }
  [[nodiscard]] const DdsConfig& config() const { return config_; }
  [[nodiscard]] Expected<void> result() const {
    if (failure_) return tl::unexpected(*failure_);
    return {};
  }

 private:
  const Participant& in_;
  const DdsConfig& config_;
  std::optional<Error> failure_;
};

/// @return it has a subscriber
[[nodiscard]] inline bool is_wanted(const std::optional<Writer>& writer) {
  return writer && writer->has_readers();
}

using WriterVisitor = std::function<void(const Writer&)>;
inline void visit_writers(const WriterVisitor& visit,
                          std::initializer_list<const std::optional<Writer>*> writers) {
  for (const auto* writer : writers)
    if (*writer) visit(**writer);
}

inline void send(std::optional<Writer>& writer, const void* sample) {
  writer->write(sample);
  writer->flush();
}

/// The topics of one body. Not written while its pose is invalid: these types have no flag for it.
class BodyTopics final {
 public:
  /// @param name  in ROS   @param alone  the server has no other body
  BodyTopics(TopicMaker& make, std::string name, bool alone);

  /// @param body  usable
  void publish(const SceneFrame& frame, const BodyPose& body, std::uint32_t jumps);
  void each(const WriterVisitor& visit) const {
    visit_writers(visit, {&pose_, &twist_, &odometry_, &px4_});
  }

 private:
  std::string name_;
  std::string world_frame_;
  AutopilotWorld px4_world_;
  SendSchedule px4_schedule_;
  std::optional<Writer> pose_;
  std::optional<Writer> twist_;
  std::optional<Writer> odometry_;
  std::optional<Writer> px4_;
};

/// The topics of all bodies: `/tf`, `/poses`, `/rigid_bodies` (one message with the usable bodies),
/// and `fiducap/bodies` (an instance per body, with its state).
///
/// Keeps its messages: allocates nothing after the first frame of a model.
class SceneTopics final {
 public:
  explicit SceneTopics(TopicMaker& make);

  /// Disposes of bodies that left the model. @param names  in ROS, in the order of the bodies
  void use(const SceneModel& model, std::vector<std::string> names);
  /// @param usable  per body of the frame
  void publish(const SceneFrame& frame, const std::vector<bool>& usable,
               const std::vector<std::uint32_t>& jumps);
  void each(const WriterVisitor& visit) const {
    visit_writers(visit, {&tf_, &poses_, &rigid_bodies_, &native_});
  }

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

/// The map: `/tf_static` (frames `tag_<id>` of settled tags) and `fiducap/tags`, both kept for late
/// subscribers. Written when the map changes, at most once a second.
class MapTopics final {
 public:
  explicit MapTopics(TopicMaker& make);

  void publish(const SceneFrame& frame);
  void each(const WriterVisitor& visit) const { visit_writers(visit, {&tf_static_, &tags_}); }

 private:
  void publish_tf(const SceneFrame& frame);
  void publish_tags(const TagMap& map);

  std::string world_frame_;
  std::shared_ptr<const TagMap> sent_;
  std::optional<Instant> sent_at_;
  std::vector<std::pair<int, Pose>> sent_tf_;  ///< On `/tf_static`.
  std::vector<int> sent_ids_;                  ///< On `fiducap/tags`.
  std::optional<Writer> tf_static_;
  std::optional<Writer> tags_;
};

/// `/diagnostics`, for rqt_robot_monitor: a status per body and one of the server, each with its
/// conditions of the event board. Once a second, and within 0.1 s when the board changes.
class HealthTopic final {
 public:
  /// @param events  nullptr: no board
  HealthTopic(TopicMaker& make, const EventBoard* events);

  void use(const SceneModel& model);
  void publish(const SceneFrame& frame);
  void each(const WriterVisitor& visit) const { visit_writers(visit, {&writer_}); }

 private:
  static constexpr std::size_t kValues = 6;
  using KeyValue = diagnostic_msgs_msg_dds__KeyValue_;
  using Text = std::array<char, 48>;  ///< Ends with a zero.
  /// One body, or the rest of the server.
  struct Part {
    std::string name;     ///< `fiducap: drone`
    std::string subject;  ///< On the board; empty: all that are not of a body.
    Text message{};
    std::array<Text, kValues> numbers{};
    std::vector<KeyValue> values;
    std::vector<std::string> texts;  ///< Memory of `values`, besides the numbers.
    std::uint8_t alarm{};            ///< Level of the worst condition.
    std::string worst;               ///< Its text.
  };
  bool read_board();
  void take_conditions(Part& part, const EventSnapshot::Events& standing) const;
  [[nodiscard]] bool is_of(const Part& part, const Event& event) const;
  void add_status(Part& part, std::uint8_t level);
  static void set_values(Part& out, const BodyPose& body);

  const EventBoard* events_;
  std::shared_ptr<const EventSnapshot> snapshot_;  ///< Of the board, as last read.
  std::string empty_;
  std::vector<Part> bodies_;
  Part server_;
  std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> statuses_;
  SendSchedule schedule_{1.0};
  SendSchedule board_schedule_{10.0};
  std::optional<Writer> writer_;
};

}  // namespace fiducap::dds
