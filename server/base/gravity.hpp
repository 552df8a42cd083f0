#pragma once

namespace fiducap {

/// What gravity is taken to be where nothing says it, m/s² …
inline constexpr double kUsualGravity_m_s2 = 9.81;
/// … and how far it may be off there, 1-sigma: at sea level it is 9.780 to 9.832.
inline constexpr double kUsualGravitySigma_m_s2 = 0.02;
/// How well it is known once it is said, or by latitude and height: what is below the ground
/// changes it by less than this nearly everywhere.
inline constexpr double kToldGravitySigma_m_s2 = 5e-4;

/// By latitude and height above sea level: Somigliana's formula with the constants of GRS80, and
/// the free-air correction to second order (H. Moritz, Geodetic Reference System 1980).
[[nodiscard]] double normal_gravity(double latitude_deg, double height_m);

}  // namespace fiducap
