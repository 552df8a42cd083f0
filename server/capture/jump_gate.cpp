#include "capture/jump_gate.hpp"

#include <algorithm>
#include <utility>

#include "base/assert.hpp"

namespace fiducap {
namespace {

// A slow camera's images may be minutes apart; a stamp of another epoch is years away.
constexpr Duration kForeign = std::chrono::hours(1);

std::size_t sensor_of(const SensorSample& sample) {
  if (std::holds_alternative<ImuSample>(sample)) return 0;
  const auto* frame = std::get_if<CameraFrame>(&sample);
  const int camera = frame != nullptr ? frame->camera : std::get<CornerFrame>(sample).camera;
  FIDUCAP_ASSERT(camera >= 0 && camera < kMostCameras);
  return static_cast<std::size_t>(camera) + 1;
}

}  // namespace

JumpGate::JumpGate(Duration jump) : jump_(jump) { out_.reserve(held_.size() + 1); }

std::vector<SensorSample>& JumpGate::take(SensorSample sample) {
  out_.clear();
  const Instant at = time_of(sample);
  Held& own = held_[sensor_of(sample)];
  bool is_sure = !is_far_ahead(at);
  if (waiting_ > 0) {
    judge_own(own, at);
    for (Held& held : held_) {
      if (!held || !is_confirmed_by(held, at)) continue;
      pass_held(held);
      is_sure = true;
    }
  }
  if (is_sure || !is_far_ahead(at)) {
    pass(std::move(sample));
  } else {
    own = std::move(sample);
    ++waiting_;
  }
  return out_;
}

/// A sensor's next sample always decides about the one that waits.
void JumpGate::judge_own(Held& held, Instant at) {
  if (!held) return;
  const Duration ahead = at - time_of(*held);
  if (ahead >= -jump_ && ahead <= kForeign) return pass_held(held);
  held.reset();
  --waiting_;
  ++dropped_;
}

bool JumpGate::is_confirmed_by(const Held& held, Instant at) const {
  const Duration apart = at - time_of(*held);
  return apart >= -jump_ && apart <= jump_;
}

bool JumpGate::is_far_ahead(Instant at) const { return !newest_ || at - *newest_ > jump_; }

std::vector<SensorSample>& JumpGate::finish() {
  out_.clear();
  const bool nothing_seen = !newest_;
  for (Held& held : held_) {
    if (!held) continue;
    if (nothing_seen || !is_far_ahead(time_of(*held))) {
      pass_held(held);
      continue;
    }
    held.reset();
    --waiting_;
    ++dropped_;
  }
  return out_;
}

void JumpGate::pass(SensorSample sample) {
  const Instant at = time_of(sample);
  newest_ = newest_ ? std::max(*newest_, at) : at;
  out_.push_back(std::move(sample));
}

void JumpGate::pass_held(Held& held) {
  pass(std::move(*held));
  held.reset();
  --waiting_;
}

}  // namespace fiducap
