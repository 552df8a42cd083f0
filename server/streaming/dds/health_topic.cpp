#include <algorithm>
#include <cstdio>

#include "streaming/dds/ros_messages.hpp"
#include "streaming/dds/topics.hpp"

namespace fiducap::dds {

namespace {

enum Level : std::uint8_t { kOk = 0, kWarning = 1, kError = 2 };

Level level_of(const BodyPose& body) {
  if (body.state == BodyState::kLost) return kError;
  return body.state == BodyState::kTracking && body.valid ? kOk : kWarning;
}

static_assert(static_cast<int>(Severity::kError) == kError);
Level level_of(Severity severity) { return static_cast<Level>(severity); }

char* key(const char* text) { return const_cast<char*>(text); }

template <std::size_t N, typename... Args>
void print(std::array<char, N>& to, const char* format, Args... args) {
  std::snprintf(to.data(), N, format, args...);  // NOLINT: bounded, cut at the end
}

}  // namespace

HealthTopic::HealthTopic(TopicMaker& make, const EventBoard* events) : events_(events) {
  server_.name = "fiducap: server";
  writer_ = make.make(make.config().diagnostics,
                      ros_topic("/diagnostics", RosType::kDiagnosticArray), {true, false, 1, 0});
}

void HealthTopic::use(const SceneModel& model) {
  bodies_.clear();
  bodies_.resize(model.bodies.size());
  statuses_.reserve(bodies_.size() + 1);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    bodies_[i].name = "fiducap: " + model.bodies[i].name;
    bodies_[i].subject = model.bodies[i].name;
  }
  snapshot_.reset();
  read_board();
}

void HealthTopic::publish(const SceneFrame& frame) {
  if (!is_wanted(writer_)) return;
  const bool has_changed = board_schedule_.is_due(frame.at, frame.rate_hz) && read_board();
  if (!schedule_.is_due(frame.at, frame.rate_hz) && !has_changed) return;
  statuses_.clear();
  for (std::size_t i = 0; i < std::min(bodies_.size(), frame.bodies.size()); ++i) {
    set_values(bodies_[i], frame.bodies[i]);
    add_status(bodies_[i], level_of(frame.bodies[i]));
  }
  print(server_.message, "%s", "runs");
  add_status(server_, kOk);
  diagnostic_msgs_msg_dds__DiagnosticArray_ message{};
  message.header = {to_ros(frame.utc_ns()), borrowed(empty_)};
  lend(message.status, statuses_);
  send(writer_, &message);
}

/// @return it has changed
bool HealthTopic::read_board() {
  const auto before = snapshot_;
  if (events_ != nullptr) events_->refresh(snapshot_);
  if (!snapshot_) snapshot_ = std::make_shared<const EventSnapshot>();
  if (snapshot_ == before) return false;
  for (Part& body : bodies_) take_conditions(body, snapshot_->standing);
  take_conditions(server_, snapshot_->standing);
  return true;
}

void HealthTopic::take_conditions(Part& part, const EventSnapshot::Events& standing) const {
  constexpr std::array<const char*, kValues> kKeys{"position sigma (m)", "rotation sigma (rad)",
                                                   "tags in view",       "age (s)",
                                                   "image rate (Hz)",    "images dropped"};
  part.texts.clear();
  part.alarm = kOk;
  part.worst.clear();
  for (const auto& held : standing) {
    const Event& event = *held;
    if (!is_of(part, event)) continue;
    const std::string key = part.subject.empty() ? event.subject + ": " + event.kind : event.kind;
    part.texts.insert(part.texts.end(), {key, event.text, key + ", remedy", event.remedy});
    const Level level = level_of(event.severity);
    if (level <= part.alarm && !part.worst.empty()) continue;
    part.alarm = level;
    part.worst = part.subject.empty() ? event.subject + ": " + event.text : event.text;
  }
  part.values.clear();
  for (std::size_t k = 0; k < kValues && !part.subject.empty(); ++k)
    part.values.push_back({key(kKeys[k]), part.numbers[k].data()});
  for (std::size_t k = 0; k < part.texts.size(); k += 2)
    part.values.push_back({part.texts[k].data(), part.texts[k + 1].data()});
}

/// Conditions of no body belong to the server.
bool HealthTopic::is_of(const Part& part, const Event& event) const {
  if (!part.subject.empty()) return part.subject == event.subject;
  return std::ranges::none_of(bodies_,
                              [&](const Part& body) { return body.subject == event.subject; });
}

void HealthTopic::add_status(Part& part, std::uint8_t level) {
  diagnostic_msgs_msg_dds__DiagnosticStatus_ status{};
  status.level = std::max(level, part.alarm);
  status.name = borrowed(part.name);
  status.message = part.worst.empty() ? part.message.data() : part.worst.data();
  status.hardware_id = borrowed(empty_);
  lend(status.values, part.values);
  statuses_.push_back(status);
}

void HealthTopic::set_values(Part& out, const BodyPose& body) {
  const std::string_view state = name_of(body.state);
  print(out.message, "%.*s%s", static_cast<int>(state.size()), state.data(),
        body.valid ? "" : ", the pose may not be used");
  print(out.numbers[0], "%.4f", body.position_sigma_m());
  print(out.numbers[1], "%.5f", body.rotation_sigma_rad());
  print(out.numbers[2], "%d", body.tags_in_view);
  print(out.numbers[3], "%.3f", to_seconds(body.age));
  print(out.numbers[4], "%.1f", body.image_rate_hz);
  print(out.numbers[5], "%llu", static_cast<unsigned long long>(body.images_dropped));
}

}  // namespace fiducap::dds
