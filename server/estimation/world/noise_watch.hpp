#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "estimation/filter/stacked_update.hpp"
#include "estimation/found_mismatch.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/world/propagation.hpp"

namespace fiducap::world {

/// Whether the residuals of an image show noise of IMU and stamps: the camera's clock is known and
/// applied, and all tags are established.
/// @param tags  used for the correction
[[nodiscard]] bool teaches_of_noise(const FilterState& state, int camera,
                                    std::span<const TagToUse> tags);

/// Estimates the noise of the IMU and the jitter of the images' stamps.
///
/// Both increase the covariance of the innovations to S + κ H D Hᵀ + τ² (H o)(H o)ᵀ, with D the
/// contribution of a unit of the IMU's variance to the pose and o the twist of the camera. The
/// derivatives of the likelihood by κ and τ² and their expected curvature need only 6 × 6 numbers
/// (Fisher scoring; R. K. Mehra, IEEE Trans. Autom. Control 15, 1970). D = ∂P/∂κ of the body is
/// tracked by a small filter that takes the tags' poses as exact.
///
/// A variance above the configured one is applied once it is significant; never one below.
class NoiseWatch final {
 public:
  NoiseWatch() { lose_motion(); }
  void restart() { *this = NoiseWatch{}; }
  /// Begins with noise learned from the same samples before.
  void begin_with(const LearnedNoise& learned) { now_ = learned; }
  [[nodiscard]] const LearnedNoise& learned() const { return now_; }
  /// The body was lost; learned noises stay.
  void lose_motion();
  /// Discards everything: it was another error.
  void unlearn();

  /// Factor of the IMU's configured variances.
  [[nodiscard]] double imu_variance() const { return now_.applied(kImu); }
  [[nodiscard]] double jitter_s() const { return std::sqrt(now_.applied(kStamps)); }
  /// Inflation factor of covariances computed with the configured IMU noise: while a larger noise
  /// is likely but not significant, and for a while after it is applied.
  [[nodiscard]] double variance_inflation() const;

  /// Appends noises worth reporting.
  void list(std::vector<FoundMismatch>& out) const;

  /// The body was propagated to an image.
  void follow(const MotionSinceImage& motion);
  /// Learns from an image. @param on_time  twist of the camera, W axes
  void learn(const StackedUpdate::SharedScore& score, const Vector6d& on_time);
  /// The image has corrected the body.
  void correct(const StackedUpdate::SharedScore& score, const Vector6d& on_time);

 private:
  enum Noise { kImu, kStamps };

  [[nodiscard]] Eigen::Matrix2d curvature() const;
  void apply_estimate();
  void reweigh();

  BodyMatrix P_;  ///< Of the body relative to tags at exact poses …
  BodyMatrix D_;  ///< … and its derivative by the variance of the IMU.
  LearnedNoise now_;
  double likely_variance_{1.0};  ///< Most likely variance of the IMU, significant or not.
  double outgrown_{1.0};         ///< Applied variance relative to that of most of the state.
};

}  // namespace fiducap::world
