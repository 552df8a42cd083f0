#include "capture/imu/device_clock.hpp"

namespace fiducap {

namespace {
// So many readings in a row are older than one before: no datagrams that overtook each other.
constexpr int kStartedAgain = 5;
}  // namespace

/// The difference to the newest count is less than half of what the counter can hold.
std::int64_t DeviceClock::unwrapped(std::uint64_t count) const {
  const int unused = 64 - bits_;
  const std::uint64_t whole = bits_ < 48 ? std::uint64_t{1} << bits_ : 0;
  const auto tick = static_cast<std::uint64_t>(tick_ns_);
  // Without signs, as the device may say anything; the mapper refuses what cannot be. One turn
  // ahead, so that what comes before the first is not negative.
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
    start_again();
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

void DeviceClock::start_again() {
  ++restarts_;
  last_count_.reset();
  mapper_ = StampMapper(true);
}

}  // namespace fiducap
