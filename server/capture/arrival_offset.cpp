#include "capture/arrival_offset.hpp"

#include <algorithm>
#include <chrono>

namespace fiducap {

namespace {

constexpr Duration kSecond = std::chrono::seconds(1);
// Before, the slope would be that of a few slow messages.
constexpr Duration kLongEnough = std::chrono::seconds(5);
constexpr std::size_t kNewestBefore = 2;  // seconds that the height is taken from until then
// A ceramic resonator, as many microcontrollers have, is wrong by half a percent.
constexpr double kSteepest = 0.01;
// What NTP leaves between two machines; a stamp further ahead is wrong.
constexpr Duration kMostAhead = std::chrono::milliseconds(50);

/// Of b against the line from a to c, in seconds.
double height_above(double ax, double ay, double bx, double by, double cx, double cy) {
  return by - ay - (cy - ay) * (bx - ax) / (cx - ax);
}

}  // namespace

/// @param k  0: the oldest
const ArrivalOffset::Quickest& ArrivalOffset::at(std::size_t k) const {
  return quickest_[(next_ + kKept - count_ + k) % kKept];
}

Duration ArrivalOffset::update(Instant stamp, Instant arrived) {
  const Duration difference = arrived - stamp;
  if (second_began_ && arrived - *second_began_ > static_cast<std::int64_t>(kKept) * kSecond)
    start_again();  // what was known is too old
  // One stamp far ahead must not move all others.
  if (count_ > 0 && difference < on_line(stamp) - kMostAhead) return on_line(stamp);
  const bool is_new = !second_began_ || arrived - *second_began_ >= kSecond;
  if (is_new) open_second(arrived);
  Quickest& present = quickest_[(next_ + kKept - 1) % kKept];
  // Against the drift, which would choose the end of the second otherwise.
  const Duration drifted = from_seconds(slope_ * to_seconds(stamp - present.stamp));
  if (is_new || difference < present.difference + drifted) {
    present = {stamp, difference};
    fit();
  }
  return on_line(stamp);
}

void ArrivalOffset::open_second(Instant arrived) {
  second_began_ = arrived;
  next_ = (next_ + 1) % kKept;
  count_ = std::min(count_ + 1, kKept);
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

/// The lower hull, point by point; then its edge at the middle.
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
  for (std::size_t k = 1; k < corners; ++k) {
    if (x[k] >= middle) return (y[k] - y[k - 1]) / (x[k] - x[k - 1]);
  }
  return 0;
}

Duration ArrivalOffset::on_line(Instant stamp) const {
  return height_ + from_seconds(slope_ * to_seconds(stamp - origin_));
}

}  // namespace fiducap
