#include "capture/stamp_mapper.hpp"

#include <algorithm>
#include <chrono>

namespace fiducap {
namespace {

constexpr Duration kSecond = std::chrono::seconds(1);
// Of a shorter time a few slow messages would decide the slope.
constexpr Duration kLongEnough = std::chrono::seconds(5);
constexpr std::size_t kNewestBefore = 2;  // seconds that define the height until then
// The ceramic resonators of many microcontrollers are off by half a percent.
constexpr double kSteepest = 0.01;
// Residual offset of NTP between two machines; a stamp further ahead is wrong.
constexpr Duration kMostAhead = std::chrono::milliseconds(50);

/// Of b against the line from a to c, in seconds.
double height_above(double ax, double ay, double bx, double by, double cx, double cy) {
  return by - ay - (cy - ay) * (bx - ax) / (cx - ax);
}

constexpr Duration kOldest = std::chrono::seconds(5);
// This many refused in a row are no outliers: the sender's clock was set.
constexpr int kMostRefused = 50;
// By arrival fewer suffice if they agree with each other: the first messages were late then.
constexpr int kMostRefusedEqually = 5;
constexpr std::int64_t kFarthest_ns = std::int64_t{1} << 62;
constexpr Duration kFarthest{kFarthest_ns / 2};  // offset plus stamp does not overflow
// Until then the offset may step: queued messages come first.
constexpr Duration kSettling = std::chrono::seconds(1);
// Afterwards it changes at most at this rate, but at once when it is off by more than kStep.
constexpr double kQuickest = 0.02;
constexpr Duration kStep = std::chrono::milliseconds(100);

bool is_sane(std::int64_t stamp_ns) { return stamp_ns >= 0 && stamp_ns < kFarthest_ns; }

// This many backward readings in a row are a restart, not datagrams out of order.
constexpr int kStartedAgain = 5;

}  // namespace

Duration ArrivalOffset::update(Instant stamp, Instant arrived) {
  const Duration difference = arrived - stamp;
  if (second_began_ && arrived - *second_began_ > static_cast<std::int64_t>(kKept) * kSecond)
    start_again();  // all that is known is too old
  if (count_ > 0 && difference < on_line(stamp) - kMostAhead) return on_line(stamp);
  const bool is_new = !second_began_ || arrived - *second_began_ >= kSecond;
  if (is_new) {
    second_began_ = arrived;
    next_ = (next_ + 1) % kKept;
    count_ = std::min(count_ + 1, kKept);
  }
  Quickest& present = quickest_[(next_ + kKept - 1) % kKept];
  // Without the drift the end of the second would be preferred.
  const Duration drifted = from_seconds(slope_ * to_seconds(stamp - present.stamp));
  if (is_new || difference < present.difference + drifted) {
    present = {stamp, difference};
    fit();
  }
  return on_line(stamp);
}

void ArrivalOffset::fit() {
  origin_ = at(0).stamp;
  const bool is_long = at(count_ - 1).stamp - origin_ >= kLongEnough;
  slope_ = is_long ? std::clamp(slope_below(), -kSteepest, kSteepest) : 0;
  height_ = Duration::max();
  const std::size_t from = is_long ? 0 : count_ - std::min(count_, kNewestBefore);
  for (std::size_t k = from; k < count_; ++k) {
    const Duration below = from_seconds(slope_ * to_seconds(at(k).stamp - origin_));
    height_ = std::min(height_, at(k).difference - below);
  }
}

/// Slope of the lower hull's edge at the middle.
double ArrivalOffset::slope_below() const {
  std::array<double, kKept> x{};
  std::array<double, kKept> y{};
  std::size_t corners = 0;
  double middle = 0;
  for (std::size_t k = 0; k < count_; ++k) {
    const double px = to_seconds(at(k).stamp - origin_);
    const double py = to_seconds(at(k).difference - at(0).difference);
    middle += px / static_cast<double>(count_);
    while (corners >= 2 && height_above(x[corners - 2], y[corners - 2], x[corners - 1],
                                        y[corners - 1], px, py) >= 0)
      --corners;
    x[corners] = px;
    y[corners++] = py;
  }
  for (std::size_t k = 1; k < corners; ++k)
    if (x[k] >= middle) return (y[k] - y[k - 1]) / (x[k] - x[k - 1]);
  return 0;
}

Duration ArrivalOffset::on_line(Instant stamp) const {
  return height_ + from_seconds(slope_ * to_seconds(stamp - origin_));
}

std::optional<Instant> StampMapper::place(std::int64_t stamp_ns, Instant arrived,
                                          std::int64_t utc_ns) {
  if (by_arrival_) return place_by(std::nullopt, stamp_ns, arrived);
  if (is_sane(stamp_ns))
    return check(instant_from_ns(stamp_ns), Duration{to_ns(arrived) - utc_ns}, arrived, false);
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
  return check(stamp, without_steps(offset, stamp, arrived), arrived, !is_known);
}

std::optional<Instant> StampMapper::check(Instant stamp, Duration offset, Instant arrived,
                                          bool by_arrival_now) {
  const Instant placed = stamp + offset;
  if (placed >= arrived - kOldest && placed <= arrived + kMostAhead) {
    refused_in_a_row_ = refused_equally_ = 0;
    return placed;
  }
  ++refused_;
  const Duration difference = arrived - stamp;
  const bool equal =
      difference < last_refused_ + kMostAhead && difference > last_refused_ - kMostAhead;
  refused_equally_ = equal ? refused_equally_ + 1 : 1;
  last_refused_ = difference;
  if (++refused_in_a_row_ >= kMostRefused ||
      (by_arrival_now && refused_equally_ >= kMostRefusedEqually)) {
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

/// Assumes that the difference to the newest count is less than half of the counter's range.
std::int64_t DeviceClock::unwrapped(std::uint64_t count) const {
  const int unused = 64 - bits_;
  const std::uint64_t whole = bits_ < 48 ? std::uint64_t{1} << bits_ : 0;
  const auto tick = static_cast<std::uint64_t>(tick_ns_);
  // Unsigned, as counts are arbitrary. One wrap ahead, so that earlier counts are not negative.
  if (!last_count_) return static_cast<std::int64_t>((count + whole) * tick);
  const auto step = static_cast<std::int64_t>((count - *last_count_) << unused) >> unused;
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(last_ns_) +
                                   static_cast<std::uint64_t>(step) * tick);
}

std::optional<Instant> DeviceClock::place(std::uint64_t count, Instant arrived,
                                          std::optional<Duration> known) {
  std::int64_t at_ns = unwrapped(count);
  if (last_count_ && at_ns <= last_ns_) {
    if (++backwards_in_a_row_ < kStartedAgain) {
      ++dropped_;
      return std::nullopt;
    }
    ++restarts_;
    last_count_.reset();
    mapper_ = StampMapper(true);
    at_ns = unwrapped(count);
  }
  backwards_in_a_row_ = 0;
  const auto placed = mapper_.place_by(known, at_ns, arrived);
  if (placed) {
    last_count_ = count;
    last_ns_ = at_ns;
  }
  if (!placed || (last_placed_ && *placed <= *last_placed_)) {
    ++dropped_;
    return std::nullopt;
  }
  last_placed_ = placed;
  return placed;
}

std::optional<Instant> DeviceClock::time_of(std::uint64_t count) const {
  constexpr std::int64_t kFar_ns = 3'600'000'000'000;
  if (!last_count_ || !last_placed_) return std::nullopt;
  const std::int64_t at_ns = unwrapped(count);
  if (at_ns > last_ns_ + kFar_ns || at_ns < last_ns_ - kFar_ns) return std::nullopt;
  return *last_placed_ + Duration{at_ns - last_ns_};
}

}  // namespace fiducap
