#include "capture/ros/stamp_mapper.hpp"

#include <algorithm>
#include <chrono>

namespace fiducap::dds {

namespace {
constexpr Duration kWindow = std::chrono::seconds(10);
constexpr Duration kOldest = std::chrono::seconds(5);
constexpr Duration kMostAhead =
    std::chrono::milliseconds(50);  // what NTP leaves between two machines
// So many in a row are no outliers: the sender's clock was set.
constexpr int kPatience = 50;
constexpr std::int64_t kFarthest_ns = std::int64_t{1} << 62;

bool is_sane(std::int64_t stamp_ns) { return stamp_ns >= 0 && stamp_ns < kFarthest_ns; }
}  // namespace

std::optional<Instant> StampMapper::place(std::int64_t stamp_ns, Instant arrived,
                                          std::int64_t utc_ns) {
  if (!is_sane(stamp_ns)) {
    ++refused_;
    return std::nullopt;
  }
  const Duration offset =
      by_arrival_ ? offset_by_arrival(stamp_ns, arrived) : Duration{to_ns(arrived) - utc_ns};
  const Instant placed = instant_from_ns(stamp_ns) + offset;
  if (placed >= arrived - kOldest && placed <= arrived + kMostAhead) {
    refused_in_a_row_ = 0;
    return placed;
  }
  ++refused_;
  if (++refused_in_a_row_ >= kPatience) start_again();
  return std::nullopt;
}

Duration StampMapper::offset_by_arrival(std::int64_t stamp_ns, Instant arrived) {
  const Duration difference = arrived - instant_from_ns(stamp_ns);
  if (!window_began_ || arrived - *window_began_ > kWindow) {
    smallest_before_ = smallest_;
    smallest_.reset();
    window_began_ = arrived;
  }
  // One stamp far ahead must not move all others: it is judged by what was known before.
  const auto known = [&] {
    if (smallest_ && smallest_before_)
      return std::optional(std::min(*smallest_, *smallest_before_));
    return smallest_ ? smallest_ : smallest_before_;
  }();
  if (known && difference < *known - kMostAhead) return *known;
  smallest_ = smallest_ ? std::min(*smallest_, difference) : difference;
  return known ? std::min(*known, *smallest_) : *smallest_;
}

void StampMapper::start_again() {
  by_arrival_ = true;
  refused_in_a_row_ = 0;
  smallest_.reset();
  smallest_before_.reset();
  window_began_.reset();
}

}  // namespace fiducap::dds
