#include "middleware/membership.hpp"

namespace fiducap::dds {

Expected<std::shared_ptr<Participant>> Membership::join() {
  const std::lock_guard lock(mutex_);
  if (auto held = participant_.lock()) {
    if (!held->is_crowded()) return held;
    return fail(ErrorCode::kUnavailable, "leaves a crowded domain; joins again in a moment",
                "domain " + std::to_string(config_.domain));
  }
  if (!*has_left_) {
    return fail(ErrorCode::kUnavailable, "is still leaving the domain; joins again in a moment",
                "domain " + std::to_string(config_.domain));
  }
  auto joined = Participant::open(config_, [this](const Crowd& crowd) {
    events_.begin({.severity = Severity::kWarning,
                   .subject = "dds",
                   .kind = "crowded",
                   .text = "left domain " + std::to_string(config_.domain) + " for a moment: " +
                           std::to_string(crowd.present) + " participants at once, " +
                           std::to_string(crowd.met) + " since it was joined",
                   .remedy = "If there are not so many ROS nodes, somebody forges them: see "
                             "docs/design/dds-exposure.md"});
  });
  if (!joined) return joined;
  *has_left_ = false;
  const std::shared_ptr<Participant> held(
      (*joined).get(), [inner = *joined, left = has_left_](Participant*) mutable {
        inner.reset();
        *left = true;
      });
  participant_ = held;
  events_.end("dds", "crowded", "has joined the domain again");
  return held;
}

}  // namespace fiducap::dds
