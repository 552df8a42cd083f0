#include "estimation/filter/corner_noise.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {
constexpr double kMedian = 7.344;  // of chi-square with 8 degrees of freedom
// In the logarithm of f, per tag seen: quick at first, then slow enough that f wanders by two per
// cent.
constexpr double kFirstStep = 0.02;
constexpr double kLastStep = 0.003;
constexpr double kStepShrinks = 0.99;
// No lens model is exact, and what it leaves is no white noise: f stays above this part of where it
// starts.
constexpr double kLeast = 0.25;
constexpr double kMost = 20.0;
}  // namespace

CornerNoise::CornerNoise(const EstimatorConfig& config, bool learns)
    : start_px_(config.corner_noise_px),
      unexplained_px_(config.corner_noise_px),
      step_(kFirstStep),
      learns_(learns) {}

double CornerNoise::of(const TagObservation& seen) const {
  return learns_ ? std::hypot(seen.corner_sigma_px, unexplained_px_) : start_px_;
}

double CornerNoise::growth(const TagObservation& seen) const {
  return learns_ ? of(seen) / std::hypot(seen.corner_sigma_px, start_px_) : 1.0;
}

void CornerNoise::learn(double distance, double share) {
  if (!learns_ || !(share > 0) || std::isnan(distance)) return;
  unexplained_px_ *= std::exp(distance > kMedian ? step_ * share : -step_ * share);
  unexplained_px_ = std::clamp(unexplained_px_, kLeast * start_px_, kMost * start_px_);
  step_ = std::max(kLastStep, step_ * kStepShrinks);
}

}  // namespace fiducap
