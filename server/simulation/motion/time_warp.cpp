#include "simulation/motion/time_warp.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap::simulation {

namespace {

// From rest to speed 1 within x = 0..1; the first three derivatives of the speed vanish at both
// ends. It covers 1/2.
TimeWarp::Point ramp_up(double x) {
  const double x3 = x * x * x;
  const double x4 = x3 * x;
  return {x4 * x * (7 + x * (-14 + x * (10 - 2.5 * x))), x4 * (35 + x * (-84 + x * (70 - 20 * x))),
          140 * x3 * std::pow(1 - x, 3)};
}

}  // namespace

TimeWarp::TimeWarp(std::optional<double> length)
    : length_(length), ramp_(length ? std::min(kRamp_s, *length) : kRamp_s) {}

TimeWarp::Point TimeWarp::at(double t) const {
  const double moving = std::max(0.0, t - kRest_s);
  if (!length_) return leg(moving);
  const double there = *length_ + ramp_;  // time of one way
  const double phase = std::fmod(moving, 2 * there);
  if (phase <= there) return leg(phase);
  const Point back = leg(2 * there - phase);
  return {back.s, -back.first, back.second};
}

TimeWarp::Point TimeWarp::leg(double t) const {
  if (t < ramp_) {
    const Point up = ramp_up(t / ramp_);
    return {ramp_ * up.s, up.first, up.second / ramp_};
  }
  if (!length_ || t <= *length_) return {t - 0.5 * ramp_, 1.0, 0.0};
  const Point down = ramp_up((*length_ + ramp_ - t) / ramp_);
  return {*length_ - ramp_ * down.s, down.first, -down.second / ramp_};
}

}  // namespace fiducap::simulation
