#pragma once

#include <span>
#include <vector>

namespace fiducap {

/// One point of an Allan plot.
struct AllanPoint {
  double tau_s{};      ///< Averaging time.
  double deviation{};  ///< Overlapping Allan deviation, in the unit of the signal.
  double freedom{};    ///< Equivalent degrees of freedom of deviation², about.
};

/// Overlapping Allan deviation of an evenly sampled rate (IEEE Std 952-1997, annex C), at averaging
/// times spaced evenly on a logarithmic axis, from one sample to a ninth of the recording.
/// @param values  one axis of gyro (rad/s) or accelerometer (m/s²)
/// @return empty when there are fewer than 18 values
[[nodiscard]] std::vector<AllanPoint> allan_deviation(std::span<const double> values,
                                                      double rate_hz);

/// Noise of one axis, continuous-time 1-sigma densities as in ImuNoise, read from its Allan plot.
struct AxisNoise {
  double white{};        ///< N: the line of slope −1/2 at τ = 1 s; unit · √s = unit / √Hz.
  double white_sigma{};  ///< Standard deviation of `white`.
  double flicker{};      ///< B: level of the flat part (bias instability is B · 0.664), unit.
  double walk{};         ///< K: the line of slope +1/2 at τ = 3 s; unit / s / √Hz.
  double walk_sigma{};
  bool walk_seen{};     ///< The plot rises at its end: `walk` is a measurement …
  double walk_bound{};  ///< … otherwise the walk is below this (95 %).

  /// σ(τ) of the three parts together.
  [[nodiscard]] double deviation(double tau_s) const;
  /// How long a recording must be until the rise by a walk of this density is seen.
  [[nodiscard]] double seconds_to_see(double walk_density) const;
};

/// Fits σ²(τ) = N²/τ + (2 ln 2/π) B² + K² τ/3 by weighted least squares, no part negative. Fitting
/// all three together keeps the middle of the plot from bending the two lines.
/// @pre at least 4 points
[[nodiscard]] AxisNoise fit_noise(std::span<const AllanPoint> points);

}  // namespace fiducap
