#include "daemon/watch/health_watch.hpp"

#include <algorithm>
#include <utility>

#include "daemon/watch/service_manager.hpp"
#include "streaming/net/guard.hpp"

namespace fiducap {

HealthWatch::HealthWatch(EventBoard& events, const Publisher& publisher, const Clock& clock,
                         std::function<void()> give_up)
    : events_(events),
      publisher_(publisher),
      clock_(clock),
      give_up_(std::move(give_up)),
      machine_(events) {}

void HealthWatch::add(int body_id, std::string name, std::size_t cameras, const BodyPulse& pulse) {
  bodies_.push_back({body_id, {std::move(name), cameras, pulse, events_}});
}

void HealthWatch::delivered(const std::shared_ptr<const SceneFrame>& frame) {
  ++delivered_;
  std::shared_ptr<const SceneFrame> old = frame;
  // Who looks may have to wait for a processor; frames do not wait for that, the next one will do.
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (lock) newest_.swap(old);
}

void HealthWatch::run(std::stop_token stop) {
  tell_service_manager("READY=1");
  while (clock_.wait_until(clock_.now() + kLook, stop)) {
    net::guarded(
        "watch", [] { return "a look at the server's health"; }, [this] { look(); });
  }
  tell_service_manager("STOPPING=1");
}

/// Also when there is no memory to say so with: it may be the reason.
void HealthWatch::give_up() {
  net::guarded(
      "watch", [] { return "the last word"; },
      [this] {
        events_.begin({.severity = Severity::kError,
                       .subject = "server",
                       .kind = "stalled",
                       .text = "no frame was delivered for ten seconds",
                       .remedy = "The process ends, so that it can be started again"});
      });
  if (give_up_) give_up_();
  gave_up_ = true;
}

void HealthWatch::look() {
  const auto verdict = frames_.look(delivered_);
  if (verdict == FrameWatchdog::Verdict::kFlows) tell_service_manager("WATCHDOG=1");
  if (verdict == FrameWatchdog::Verdict::kDead && !gave_up_) give_up();
  std::shared_ptr<const SceneFrame> frame;
  {
    const std::lock_guard lock(mutex_);
    frame = newest_;
  }
  const Instant now = clock_.now();
  for (Body& body : bodies_) {
    const BodyPose* pose = nullptr;
    if (frame) {
      const auto found = std::find_if(frame->bodies.begin(), frame->bodies.end(),
                                      [&](const BodyPose& one) { return one.body_id == body.id; });
      if (found != frame->bodies.end()) pose = &*found;
    }
    body.health.look(pose, now);
  }
  MachineState machine = read_machine_state();
  machine.frames = publisher_.frames();
  machine.missed = publisher_.missed();
  machine_.look(machine, now);
}

}  // namespace fiducap
