#include "calibration/extrinsics/calm_watch.hpp"

#include <algorithm>

namespace fiducap {
namespace {

constexpr double kFast_s = 0.05;
constexpr double kSlow_s = 0.5;
constexpr double kTurning_rad_s = 0.5;
constexpr double kShaking_m_s2 = 1.0;
constexpr double kLongestStep_s = 0.25;

}  // namespace

void CalmWatch::add(const ImuSample& sample) {
  if (!sample.w_WB_B.allFinite() || !sample.f_B.allFinite()) return;
  const double step = to_seconds(sample.sampled_at - last_at_.value_or(sample.sampled_at));
  if (step < 0 || step > kLongestStep_s) *this = CalmWatch();
  const double dt = last_at_ ? step : 0;
  last_at_ = sample.sampled_at;
  ++samples_;
  // Plain means at first: a single reading is mostly noise.
  const double first = 1.0 / samples_;
  const double fast = std::max(first, dt / (kFast_s + dt));
  w_ += fast * (sample.w_WB_B - w_);
  f_ += fast * (sample.f_B - f_);
  slow_f_ += std::max(first, dt / (kSlow_s + dt)) * (sample.f_B - slow_f_);
  const bool calm = w_.norm() < kTurning_rad_s && (f_ - slow_f_).norm() < kShaking_m_s2;
  calm_s_ = calm ? calm_s_ + dt : 0;
}

std::optional<Instant> first_calm(const LoadedSamples& samples) {
  CalmWatch watch;
  std::optional<Instant> began, newest_tag;
  auto frame = samples.frames.begin();
  for (const ImuSample& imu : samples.imu) {
    watch.add(imu);
    if (watch.calm_s() == 0) began.reset();
    if (watch.calm_s() > 0 && !began) began = imu.sampled_at;
    for (; frame != samples.frames.end() && frame->exposed_at <= imu.sampled_at; ++frame)
      if (!frame->tags.empty()) newest_tag = frame->exposed_at;
    if (began && watch.is_calm() && newest_tag >= began) return began;
  }
  return std::nullopt;
}

}  // namespace fiducap
