#include "capture/stamp_mapper.hpp"

#include <algorithm>
#include <chrono>

namespace fiducap {

namespace {
constexpr Duration kOldest = std::chrono::seconds(5);
constexpr Duration kMostAhead =
    std::chrono::milliseconds(50);  // what NTP leaves between two machines
// So many in a row are no outliers: the sender's clock was set.
constexpr int kPatience = 50;
// … or so many that agree with each other, when it is only by arrival that they were refused: then
// it was the first ones that came late.
constexpr int kAlike = 5;
constexpr std::int64_t kFarthest_ns = std::int64_t{1} << 62;
constexpr Duration kFarthest{kFarthest_ns / 2};  // for an offset: added to a stamp it still fits
// So long what is known of the clocks becomes better by leaps: what had waited comes first.
constexpr Duration kSettling = std::chrono::seconds(1);
// Afterwards by so much per second, but at once if it was wrong by more than this.
constexpr double kQuickest = 0.02;
constexpr Duration kStep = std::chrono::milliseconds(100);

bool is_sane(std::int64_t stamp_ns) { return stamp_ns >= 0 && stamp_ns < kFarthest_ns; }
}  // namespace

std::optional<Instant> StampMapper::place(std::int64_t stamp_ns, Instant arrived,
                                          std::int64_t utc_ns) {
  if (by_arrival_) return place_by(std::nullopt, stamp_ns, arrived);
  if (is_sane(stamp_ns))
    return judge(instant_from_ns(stamp_ns), Duration{to_ns(arrived) - utc_ns}, arrived, false);
  ++refused_;
  return std::nullopt;
}

std::optional<Instant> StampMapper::place_by(std::optional<Duration> known, std::int64_t stamp_ns,
                                             Instant arrived) {
  if (!is_sane(stamp_ns)) {
    ++refused_;
    return std::nullopt;
  }
  const Instant stamp = instant_from_ns(stamp_ns);
  const Duration by_arrivals = arrivals_.update(stamp, arrived);
  const bool is_known = known && !by_arrival_ && *known<kFarthest&& * known> - kFarthest;
  const Duration offset = is_known ? *known : by_arrivals;
  return judge(stamp, without_steps(offset, stamp, arrived), arrived, !is_known);
}

std::optional<Instant> StampMapper::judge(Instant stamp, Duration offset, Instant arrived,
                                          bool by_arrival_now) {
  const Instant placed = stamp + offset;
  if (placed >= arrived - kOldest && placed <= arrived + kMostAhead) {
    refused_in_a_row_ = refused_alike_ = 0;
    return placed;
  }
  ++refused_;
  const Duration difference = arrived - stamp;
  const bool alike =
      difference < last_refused_ + kMostAhead && difference > last_refused_ - kMostAhead;
  refused_alike_ = alike ? refused_alike_ + 1 : 1;
  last_refused_ = difference;
  if (++refused_in_a_row_ >= kPatience || (by_arrival_now && refused_alike_ >= kAlike)) {
    start_again();
    by_arrival_ = by_arrival_ || !by_arrival_now;
  }
  return std::nullopt;
}

Duration StampMapper::without_steps(Duration wanted, Instant stamp, Instant arrived) {
  if (!added_) {
    began_ = arrived;
    newest_ = stamp;
  }
  const Duration passed = std::max(stamp - newest_, Duration{0});
  const bool steps = !added_ || arrived - began_ < kSettling || wanted - *added_ > kStep ||
                     *added_ - wanted > kStep;
  if (steps) {
    added_ = wanted;
  } else {
    const Duration most = from_seconds(kQuickest * to_seconds(passed));
    *added_ += std::clamp(wanted - *added_, -most, most);
  }
  newest_ += passed;
  return *added_;
}

void StampMapper::start_again() {
  refused_in_a_row_ = refused_alike_ = 0;
  arrivals_.start_again();
  added_.reset();
}

}  // namespace fiducap
