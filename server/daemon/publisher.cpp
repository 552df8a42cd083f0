#include "daemon/publisher.hpp"

#include <cmath>
#include <utility>

#include "base/log.hpp"
#include "base/text.hpp"
#include "daemon/system.hpp"

namespace fiducap {
namespace {
constexpr Duration kReadUtcEvery = std::chrono::seconds(1);
constexpr double kJump_s = 0.5;  // more is no correction of the clock's rate
}  // namespace

Publisher::Publisher(double rate_hz, Scene& scene, const MapBuilder& map, const Clock& clock,
                     Receiver receiver)
    : rate_hz_(rate_hz),
      period_(from_seconds(1 / rate_hz)),
      scene_(scene),
      map_(map),
      clock_(clock),
      receiver_(std::move(receiver)),
      utc_offset_(utc_offset()),
      utc_read_at_(clock.now()) {}

void Publisher::run(std::stop_token stop) {
  set_realtime_priority();
  Instant next = clock_.now();
  while (clock_.wait_until(next, stop)) {
    // An exception (no memory) costs this frame; reported from time to time.
    const auto whose = [this] { return failures_++ % 1000 == 0 ? "a frame" : ""; };
    log::guarded("publisher", whose, [this] { publish(); });
    next += period_;
    const Duration late = clock_.now() - next;
    if (late < Duration::zero()) continue;
    const auto skipped = late / period_ + 1;
    missed_ += static_cast<std::uint64_t>(skipped);
    next += skipped * period_;
  }
}

/// A computer without a battery-backed clock gets its time some time after the start.
void Publisher::read_utc(Instant now) {
  const Duration before = std::exchange(utc_offset_, utc_offset());
  utc_read_at_ = now;
  const double jump_s = to_seconds(utc_offset_ - before);
  if (std::abs(jump_s) > kJump_s)
    log::warning("daemon", "the computer's time was set " + fixed(std::abs(jump_s), 1) + " s " +
                               (jump_s > 0 ? "ahead" : "back") +
                               ": stamps in UTC (ROS 2, VRPN, Qualisys) jump by that");
}

void Publisher::publish() {
  const Instant now = clock_.now();
  if (now - utc_read_at_ >= kReadUtcEvery) read_utc(now);
  receiver_(scene_.sample(now, now, utc_offset_, rate_hz_, map_.snapshot()));
  ++frames_;
}

}  // namespace fiducap
