#include "streaming/dds/health_topic.hpp"

#include <algorithm>
#include <cstdio>

#include "streaming/dds/ros_types.hpp"

namespace fiducap::dds {

namespace {

enum Level : std::uint8_t { kOk = 0, kWarning = 1, kError = 2 };

Level level_of(const BodyPose& body) {
  if (body.state == BodyState::kLost) return kError;
  return body.state == BodyState::kTracking && body.valid ? kOk : kWarning;
}

char* key(const char* text) { return const_cast<char*>(text); }

template <std::size_t N, typename... Args>
void print(std::array<char, N>& to, const char* format, Args... args) {
  std::snprintf(to.data(), N, format, args...);  // NOLINT: bounded, cut at the end
}

}  // namespace

HealthTopic::HealthTopic(TopicMaker& make) {
  writer_ = make.make(make.config().diagnostics,
                      ros_topic("/diagnostics", RosType::kDiagnosticArray), {true, false, 1, 0});
}

void HealthTopic::use(const SceneModel& model) {
  bodies_.clear();
  bodies_.resize(model.bodies.size());
  statuses_.reserve(bodies_.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    Body& body = bodies_[i];
    body.name = "fiducap: " + model.bodies[i].name;
    constexpr std::array<const char*, kValues> kKeys{"position sigma (m)", "rotation sigma (rad)",
                                                     "tags in view",       "age (s)",
                                                     "image rate (Hz)",    "images dropped"};
    for (std::size_t k = 0; k < kValues; ++k)
      body.pairs[k] = {key(kKeys[k]), body.values[k].data()};
  }
}

void HealthTopic::publish(const SceneFrame& frame) {
  if (!is_wanted(writer_) || !schedule_.is_due(frame.at, frame.rate_hz)) return;
  statuses_.clear();
  for (std::size_t i = 0; i < std::min(bodies_.size(), frame.bodies.size()); ++i) {
    Body& body = bodies_[i];
    tell(body, frame.bodies[i]);
    diagnostic_msgs_msg_dds__DiagnosticStatus_ status{};
    status.level = level_of(frame.bodies[i]);
    status.name = borrowed(body.name);
    status.message = body.message.data();
    status.hardware_id = borrowed(empty_);
    status.values._length = status.values._maximum = kValues;
    status.values._buffer = body.pairs.data();
    statuses_.push_back(status);
  }
  diagnostic_msgs_msg_dds__DiagnosticArray_ message{};
  message.header = {to_ros(frame.utc_ns()), borrowed(empty_)};
  message.status._length = message.status._maximum = static_cast<std::uint32_t>(statuses_.size());
  message.status._buffer = statuses_.data();
  send(writer_, &message);
}

void HealthTopic::tell(Body& out, const BodyPose& body) {
  const std::string_view state = name_of(body.state);
  print(out.message, "%.*s%s", static_cast<int>(state.size()), state.data(),
        body.valid ? "" : ", the pose may not be used");
  print(out.values[0], "%.4f", body.position_sigma_m());
  print(out.values[1], "%.5f", body.rotation_sigma_rad());
  print(out.values[2], "%d", body.tags_in_view);
  print(out.values[3], "%.3f", to_seconds(body.age));
  print(out.values[4], "%.1f", body.image_rate_hz);
  print(out.values[5], "%llu", static_cast<unsigned long long>(body.images_dropped));
}

void HealthTopic::each(const std::function<void(const Writer&)>& visit) const {
  if (writer_) visit(*writer_);
}

}  // namespace fiducap::dds
