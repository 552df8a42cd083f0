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
  if (!last_at_) {
    w_ = sample.w_WB_B;
    f_ = slow_f_ = sample.f_B;
  }
  const double step = to_seconds(sample.sampled_at - last_at_.value_or(sample.sampled_at));
  last_at_ = sample.sampled_at;
  if (step < 0 || step > kLongestStep_s) calm_s_ = 0;
  const double dt = std::clamp(step, 0.0, kLongestStep_s);
  const double fast = dt / (kFast_s + dt);
  w_ += fast * (sample.w_WB_B - w_);
  f_ += fast * (sample.f_B - f_);
  slow_f_ += dt / (kSlow_s + dt) * (f_ - slow_f_);
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
