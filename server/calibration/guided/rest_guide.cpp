#include "calibration/guided/rest_guide.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {
namespace {

constexpr double kAveraged_s = 1;
// Far above what any unit does at rest: a touch, a step on the floor. Finer motion is found in the
// end, over all samples.
constexpr double kTouched_rad_s = 0.1;
constexpr double kTouched_m_s2 = 1.0;
// Of one session; a unit of 8 kHz would fill the memory otherwise.
constexpr std::size_t kMostReadings = 600'000;

}  // namespace

void RestGuide::take(const ImuSample& sample) {
  if (!sample.w_WB_B.allFinite() || !sample.f_B.allFinite() || is_enough()) return;
  if (!samples_.empty() && sample.sampled_at <= samples_.back().sampled_at) return;
  if (has_moved(sample) || samples_.size() >= kMostReadings) {
    begin();
    moved_ = true;
  }
  take_mean(sample);
  samples_.push_back(sample);
}

bool RestGuide::has_moved(const ImuSample& sample) const {
  if (samples_.empty() || share() * kLongEnough_s < kAveraged_s) return false;
  return (sample.w_WB_B - mean_w_).cwiseAbs().maxCoeff() > kTouched_rad_s ||
         (sample.f_B - mean_f_).cwiseAbs().maxCoeff() > kTouched_m_s2;
}

void RestGuide::take_mean(const ImuSample& sample) {
  if (share() * kLongEnough_s >= kAveraged_s) return;
  ++averaged_;
  mean_w_ += (sample.w_WB_B - mean_w_) / averaged_;
  mean_f_ += (sample.f_B - mean_f_) / averaged_;
}

double RestGuide::share() const {
  if (samples_.empty()) return 0;
  const double seconds = to_seconds(samples_.back().sampled_at - samples_.front().sampled_at);
  return std::min(1.0, seconds / kLongEnough_s);
}

std::string RestGuide::hint() const {
  if (samples_.empty()) return "Nothing has come from the IMU yet.";
  if (is_enough()) return "Enough.";
  const int left = static_cast<int>(std::ceil((1 - share()) * kLongEnough_s));
  return std::string(moved_ ? "It moved; it is begun again. " : "") +
         "Let it lie on a table that nobody touches: " + std::to_string(left) + " s more.";
}

Expected<StaticImuNoise> RestGuide::result() const {
  return identify_static_imu(samples_, "the IMU");
}

void RestGuide::begin() {
  samples_.clear();
  mean_w_.setZero();
  mean_f_.setZero();
  averaged_ = 0;
}

}  // namespace fiducap
