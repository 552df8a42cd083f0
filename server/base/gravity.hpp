#pragma once

#include <cmath>
#include <numbers>

namespace fiducap {

/// Default magnitude of gravity, m/s², and its sigma: at sea level it is 9.780 to 9.832.
inline constexpr double kUsualGravity_m_s2 = 9.81;
inline constexpr double kUsualGravitySigma_m_s2 = 0.02;
/// Sigma of a configured value, or of one by latitude and height (the ground changes it by less).
inline constexpr double kGivenGravitySigma_m_s2 = 5e-4;

inline constexpr double kStandardGravity_m_s2 = 9.80665;

/// Gravity by latitude and height above sea level: Somigliana's formula with the constants of
/// GRS80, and the free-air correction to second order (H. Moritz, Geodetic Reference System 1980).
[[nodiscard]] inline double normal_gravity(double latitude_deg, double height_m) {
  constexpr double kEquator_m_s2 = 9.7803267715;
  constexpr double kShape = 0.001931851353;
  constexpr double kEccentricity2 = 0.00669438002290;
  constexpr double kSemiMajor_m = 6378137.0;
  constexpr double kFlattening = 0.00335281068118;
  constexpr double kCentrifugal = 0.00344978600308;  // at the equator, as a share of gravity
  const double s = std::sin(latitude_deg * std::numbers::pi / 180);
  const double s2 = s * s;
  const double at_sea = kEquator_m_s2 * (1 + kShape * s2) / std::sqrt(1 - kEccentricity2 * s2);
  const double up = height_m / kSemiMajor_m;
  return at_sea *
         (1 - 2 * (1 + kFlattening + kCentrifugal - 2 * kFlattening * s2) * up + 3 * up * up);
}

}  // namespace fiducap
