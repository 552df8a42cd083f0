#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/imu_sample.hpp"

namespace fiducap {

/// One point of an Allan plot.
struct AllanPoint {
  double tau_s{};      ///< Averaging time.
  double deviation{};  ///< Overlapping Allan deviation, in the unit of the signal.
  double freedom{};    ///< Approximate equivalent degrees of freedom of deviation².
};

/// Overlapping Allan deviation of an evenly sampled signal (IEEE Std 952-1997, annex C), at
/// averaging times spaced evenly on a logarithmic axis, from one sample to a ninth of the
/// recording.
/// @param values  one axis of gyroscope (rad/s) or accelerometer (m/s²)
/// @return empty when there are fewer than 18 values
[[nodiscard]] std::vector<AllanPoint> allan_deviation(std::span<const double> values,
                                                      double rate_hz);

/// Noise of one axis, continuous-time 1-sigma densities as in ImuNoise, from its Allan plot.
struct AxisNoise {
  double white{};        ///< N: the line of slope −1/2 at τ = 1 s; unit · √s = unit / √Hz.
  double white_sigma{};  ///< Standard deviation of `white`.
  double flicker{};      ///< B: level of the flat part (bias instability is B · 0.664), unit.
  double walk{};         ///< K: the line of slope +1/2 at τ = 3 s; unit / s / √Hz.
  double walk_sigma{};
  bool walk_seen{};     ///< The plot rises at its end: `walk` is a measurement.
  double walk_bound{};  ///< Upper bound of the walk (95 %), when it is not seen.

  /// σ(τ) of the three parts together.
  [[nodiscard]] double deviation(double tau_s) const;
  /// Duration of a recording that shows a walk of this density.
  [[nodiscard]] double seconds_to_see(double walk_density) const;
};

/// Fits σ²(τ) = N²/τ + (2 ln 2/π) B² + K² τ/3 by weighted least squares, no part negative. The
/// joint fit keeps the flat part from biasing the two lines.
/// @pre at least 4 points
[[nodiscard]] AxisNoise fit_noise(std::span<const AllanPoint> points);

/// Axes in the order gyroscope x y z, accelerometer x y z.
inline constexpr std::size_t kImuAxes = 6;

/// Noise of an IMU, from a recording at rest.
struct StaticImuNoise {
  double seconds{};
  double rate_hz{};
  long samples{};
  long lost{};  ///< Samples missing by the stamps of their neighbours.
  std::array<std::vector<AllanPoint>, kImuAxes> plot;
  std::array<AxisNoise, kImuAxes> axes;
  /// One value per sensor, as used by filters: root mean square over the axes. The walk is its
  /// upper bound when no axis shows it.
  ImuNoise noise;
  bool gyro_walk_seen{};  ///< On at least one axis; otherwise noise.gyro_walk… is an upper bound.
  bool accel_walk_seen{};
};

/// @return Error when the recording is too short or has gaps, or, with the time, when the IMU moved
[[nodiscard]] Expected<StaticImuNoise> identify_static_imu(std::span<const ImuSample> samples,
                                                           const std::string& context);

/// Deterministic errors of an IMU, from rests in many attitudes.
struct MultiPoseImu {
  ImuCorrection correction;
  Eigen::Vector3d accel_bias_sigma_m_s2{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_scale_sigma{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gyro_scale_sigma{Eigen::Vector3d::Zero()};
  int rests{};
  int turns{};  ///< Rotations by more than 5° between rests: measurements of the gyroscope.
  double seconds{};
  /// | |f| − g | over the rests, root mean square, m/s²; uncorrected and corrected.
  double gravity_rms_before{};
  double gravity_rms_after{};
  /// Angle between the vertical propagated by the gyroscope from one rest to the next and the
  /// vertical measured there, root mean square, rad; uncorrected (bias removed) and corrected.
  double up_rms_before{};
  double up_rms_after{};
};

/// Bias, scale and misalignment of an IMU that was put down in many attitudes. Rests are detected
/// by the scatter of the accelerometer, with the threshold that gives the best fit of the
/// accelerometer. Body axes are the accelerometer's: z along its z, x in its xz plane.
/// Method: D. Tedaldi, A. Pretto, E. Menegatti, "A robust and easy to implement method for IMU
/// calibration without external equipments", ICRA 2014; here with the gyroscope's bias from the
/// rests before and after each rotation.
/// @return Error naming what is missing
[[nodiscard]] Expected<MultiPoseImu> calibrate_multi_pose(std::span<const ImuSample> samples,
                                                          double gravity_m_s2,
                                                          const std::string& context);

}  // namespace fiducap
