#include "daemon/publisher.hpp"

#include <utility>

#include "daemon/system_clock.hpp"
#include "daemon/urgency.hpp"
#include "streaming/net/guard.hpp"

namespace fiducap {

Publisher::Publisher(double rate_hz, Scene& scene, const MapBuilder& map, const Clock& clock,
                     Receiver receiver)
    : rate_hz_(rate_hz),
      period_(from_seconds(1 / rate_hz)),
      scene_(scene),
      map_(map),
      clock_(clock),
      receiver_(std::move(receiver)),
      utc_offset_(utc_offset()) {}

void Publisher::run(std::stop_token stop) {
  run_urgently();
  Instant next = clock_.now();
  while (clock_.wait_until(next, stop)) {
    // What it throws (no memory) costs this frame, said once a while.
    const auto whose = [this] { return failures_++ % 1000 == 0 ? "a frame" : ""; };
    net::guarded("publisher", whose, [this] { publish(); });
    next += period_;
    const Duration late = clock_.now() - next;
    if (late < Duration::zero()) continue;
    const auto skipped = late / period_ + 1;
    missed_ += static_cast<std::uint64_t>(skipped);
    next += skipped * period_;
  }
}

void Publisher::publish() {
  constexpr std::uint64_t kFramesPerOffset = 1000;  // the wall clock is corrected slowly
  if (frames_ % kFramesPerOffset == 0) utc_offset_ = utc_offset();
  const Instant now = clock_.now();
  receiver_(scene_.sample(now, now, utc_offset_, rate_hz_, map_.snapshot()));
  ++frames_;
}

}  // namespace fiducap
