#include "daemon/bodies/body_inbox.hpp"

#include <algorithm>
#include <utility>

namespace fiducap {

bool BodyInbox::push(SensorSample sample, Instant arrived) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return false;
    if (!std::holds_alternative<ImuSample>(sample)) {
      arrivals_[next_arrival_++ % arrivals_.size()] = {time_of(sample), arrived};
    }
    if (!merger_.push(std::move(sample))) return false;
  }
  filled_.notify_one();
  return true;
}

void BodyInbox::finish() {
  {
    const std::lock_guard lock(mutex_);
    finished_ = true;
    merger_.finish();
  }
  filled_.notify_one();
}

void BodyInbox::set_clock_shift(int camera, Duration shift) {
  const std::lock_guard lock(mutex_);
  merger_.set_clock_shift(camera, shift);
}

void BodyInbox::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  filled_.notify_one();
}

std::optional<Delivery> BodyInbox::pop(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  std::optional<SensorSample> next;
  filled_.wait(lock, stop, [&] {
    if (!closed_) next = merger_.pop();
    return next.has_value() || finished_ || closed_;
  });
  if (!next || stop.stop_requested()) return std::nullopt;
  const Instant arrived = arrival_of(*next);
  return Delivery{std::move(*next), arrived};
}

MergerStatistics BodyInbox::statistics() const {
  const std::lock_guard lock(mutex_);
  return merger_.statistics();
}

Instant BodyInbox::arrival_of(const SensorSample& sample) const {
  const Instant at = time_of(sample) - clock_shift_of(sample);
  if (std::holds_alternative<ImuSample>(sample)) return at;
  const auto found = std::find_if(arrivals_.begin(), arrivals_.end(),
                                  [&](const Arrival& a) { return a.stamp == at; });
  return found == arrivals_.end() ? at : found->arrived;
}

}  // namespace fiducap
