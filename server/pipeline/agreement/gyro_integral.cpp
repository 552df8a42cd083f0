#include "pipeline/agreement/gyro_integral.hpp"

#include <algorithm>
#include <utility>

namespace fiducap {

namespace {

// Between two readings further apart the body may have turned and turned back.
constexpr Duration kLongestStep = std::chrono::milliseconds(60);
// Not a reading out of order, but another time.
constexpr Duration kOtherClock = std::chrono::seconds(1);
constexpr double kClipped = 0.98;

std::int64_t step_at_or_after(Instant t, Duration step) {
  const std::int64_t ns = to_ns(t);
  return ns / step.count() + (ns % step.count() > 0 ? 1 : 0);
}

}  // namespace

void GyroIntegral::begin_anew() {
  last_.reset();
  begin_ = end_ = 0;
}

void GyroIntegral::add(const ImuSample& imu) {
  if (!imu.w_WB_B.allFinite()) return;
  const bool is_clipped =
      range_rad_s_ > 0 && imu.w_WB_B.cwiseAbs().maxCoeff() > kClipped * range_rad_s_;
  if (is_clipped) return begin_anew();
  const std::optional<ImuSample> before = std::exchange(last_, imu);
  const bool is_back = before && imu.sampled_at <= before->sampled_at;
  if (is_back && before->sampled_at - imu.sampled_at < kOtherClock) {
    last_ = before;  // the merger drops such a reading, too
    return;
  }
  if (!before || is_back || imu.sampled_at - before->sampled_at > kLongestStep) {
    begin_ = end_ = step_at_or_after(imu.sampled_at, kStep);
    last_sum_.setZero();
    return;
  }
  const double span_s = to_seconds(imu.sampled_at - before->sampled_at);
  const Eigen::Vector3d turn = 0.5 * span_s * (before->w_WB_B + imu.w_WB_B);
  for (; Instant{end_ * kStep} <= imu.sampled_at; ++end_) {
    const double share = to_seconds(Instant{end_ * kStep} - before->sampled_at) / span_s;
    sum(end_) = last_sum_ + share * turn;
  }
  last_sum_ += turn;
  begin_ = std::max(begin_, end_ - kSteps);
}

std::optional<Eigen::Vector3d> GyroIntegral::turn(Instant from, Instant to) const {
  if (!covers(from, to)) return std::nullopt;
  return at(to) - at(from);
}

/// @pre known
Eigen::Vector3d GyroIntegral::at(Instant t) const {
  const std::int64_t after = std::clamp(step_at_or_after(t, kStep), begin_, end_ - 1);
  const double behind = to_seconds(Instant{after * kStep} - t) / to_seconds(kStep);
  if (behind <= 0 || after == begin_) return sum(after);
  return sum(after) + behind * (sum(after - 1) - sum(after));
}

}  // namespace fiducap
