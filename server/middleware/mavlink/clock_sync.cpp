#include "middleware/mavlink/clock_sync.hpp"

#include <algorithm>
#include <chrono>

#include "middleware/net/peer.hpp"

namespace fiducap::mavlink {

namespace {
constexpr Duration kQuickPeriod = std::chrono::milliseconds(100);
constexpr Duration kSlowPeriod = std::chrono::seconds(1);
constexpr Duration kLongestTrip = std::chrono::seconds(1);
constexpr Duration kMemory = std::chrono::seconds(10);
}  // namespace

std::optional<Timesync> ClockSync::next_request(Instant now) {
  if (next_request_at_ && now < *next_request_at_) return std::nullopt;
  next_request_at_ = now + (reply_count_ < kKept ? kQuickPeriod : kSlowPeriod);
  const auto number = static_cast<std::int64_t>(net::random_word() >> 1 | 1);
  requests_[request_count_++ % kKept] = Request{now, number};
  return Timesync{0, number};
}

bool ClockSync::accept_reply(const Timesync& reply, Instant now) {
  const auto found = std::ranges::find_if(
      requests_, [&](const auto& one) { return one && one->number == reply.ts1_ns; });
  if (found == requests_.end()) return false;
  const Instant sent = (*found)->at;
  if (now < sent || now - sent > kLongestTrip) return false;
  found->reset();  // a reply counts once
  const Duration trip = now - sent;
  // Unsigned, so that any number of the autopilot wraps without overflow.
  const auto midway = static_cast<std::uint64_t>(to_ns(sent) + trip.count() / 2);
  const auto offset = static_cast<std::int64_t>(static_cast<std::uint64_t>(reply.tc1_ns) - midway);
  measured_[reply_count_++ % kKept] = Measured{now, {Duration{offset}, trip / 2}};
  return true;
}

std::optional<ClockSync::Offset> ClockSync::offset(Instant now, double drift) const {
  std::optional<Offset> best;
  for (const auto& one : measured_) {
    if (!one || now - one->at > kMemory) continue;
    if (best && one->offset.bound >= best->bound) continue;
    best = one->offset;
    // Unsigned as above.
    const auto carried = from_seconds(drift * to_seconds(now - one->at)).count();
    best->to_autopilot =
        Duration{static_cast<std::int64_t>(static_cast<std::uint64_t>(best->to_autopilot.count()) +
                                           static_cast<std::uint64_t>(carried))};
  }
  return best;
}

}  // namespace fiducap::mavlink
