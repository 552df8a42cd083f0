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

std::optional<Timesync> ClockSync::question(Instant now) {
  if (next_question_ && now < *next_question_) return std::nullopt;
  next_question_ = now + (answers_ < kKept ? kQuickPeriod : kSlowPeriod);
  const auto number = static_cast<std::int64_t>(net::random_word() >> 1 | 1);
  asked_[next_asked_++ % kKept] = Question{now, number};
  return Timesync{0, number};
}

bool ClockSync::answer(const Timesync& answer, Instant now) {
  const auto found = std::find_if(asked_.begin(), asked_.end(), [&](const auto& one) {
    return one && one->number == answer.ts1_ns;
  });
  if (found == asked_.end()) return false;
  const Instant asked = (*found)->at;
  if (now < asked || now - asked > kLongestTrip) return false;
  found->reset();  // an answer counts once
  const Duration trip = now - asked;
  // Wraps instead of overflowing: the autopilot may say anything.
  const auto midway = static_cast<std::uint64_t>(to_ns(asked) + trip.count() / 2);
  const auto offset = static_cast<std::int64_t>(static_cast<std::uint64_t>(answer.tc1_ns) - midway);
  measured_[answers_++ % kKept] = Measured{now, {Duration{offset}, trip / 2}};
  return true;
}

std::optional<ClockSync::Offset> ClockSync::offset(Instant now, double drift) const {
  std::optional<Offset> best;
  for (const auto& one : measured_) {
    if (!one || now - one->at > kMemory) continue;
    if (best && one->offset.doubt >= best->doubt) continue;
    best = one->offset;
    // Wraps as well.
    const auto carried = from_seconds(drift * to_seconds(now - one->at)).count();
    best->to_autopilot =
        Duration{static_cast<std::int64_t>(static_cast<std::uint64_t>(best->to_autopilot.count()) +
                                           static_cast<std::uint64_t>(carried))};
  }
  return best;
}

}  // namespace fiducap::mavlink
