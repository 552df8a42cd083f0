#include "streaming/vicon/frame_numbers.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap::vicon {

namespace {

constexpr std::int64_t kNumbers = std::int64_t{1} << 31;
// Ticks are late, hardly ever early: three quarters of a period late is still the same tick, a quarter early too.
constexpr double kEarly = 0.25;

}  // namespace

std::uint32_t FrameNumbers::next(Instant at, double rate_hz) {
  if (!start_ || rate_hz != rate_hz_) {
    start_ = at;
    rate_hz_ = rate_hz;
    first_ = next_;
  }
  const auto ticks = static_cast<std::int64_t>(std::floor(to_seconds(at - *start_) * rate_hz + kEarly));
  const std::int64_t number = std::max(next_, first_ + ticks);
  next_ = number + 1;
  return static_cast<std::uint32_t>(number % kNumbers);
}

}  // namespace fiducap::vicon
