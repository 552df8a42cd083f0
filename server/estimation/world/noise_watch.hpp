#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimation/filter/stacked_update.hpp"
#include "estimation/found_mismatch.hpp"
#include "estimation/start/learned_noise.hpp"
#include "estimation/world/propagation.hpp"

namespace fiducap::world {

/// Whether the IMU is noisier than it is said to be, and whether the images' stamps jitter.
///
/// Both make the camera's pose at an image less certain than the filter reckons: the covariance of
/// its innovations is S + κ H D Hᵀ + τ² (H o)(H o)ᵀ, with D what a unit of the IMU's variance adds
/// to the pose and o the twist of the camera. The likelihood's derivatives by κ and τ² and their
/// expected curvature need no more than 6 × 6 numbers (Fisher scoring; R. K. Mehra, IEEE
/// Trans. Autom. Control 15, 1970). D = ∂P/∂κ of the body is followed by a small filter of its own
/// that takes the tags' places as exact: what an image corrects is the body against the tags.
///
/// A noise above the declared one is applied once it is significant; never one below.
class NoiseWatch final {
 public:
  NoiseWatch() { lose_motion(); }
  void restart() { *this = NoiseWatch{}; }
  /// As it was learned from the same samples, once before.
  void begin_with(const LearnedNoise& learned);
  [[nodiscard]] const LearnedNoise& learned() const { return now_; }
  /// What is known of the motion ends here; what was learned of the noises stays.
  void lose_motion();
  /// What was learned from the last images was another error's …
  void take_back();
  /// … or from those since now, which nothing fits, may turn out to be a tag's.
  void begin_doubt() { doubted_since_ = now_; }
  void end_doubt() { doubted_since_.reset(); }
  void take_back_doubted();
  /// All that was learned was another error's.
  void unlearn();

  /// The variance of the IMU's noises is so many times the declared one.
  [[nodiscard]] double imu_variance() const { return now_.applied(kImu); }
  [[nodiscard]] double jitter_s() const { return std::sqrt(now_.applied(kStamps)); }
  /// By so much all variances are too small that were reckoned with the IMU's declared noise: while
  /// it is only suspected, and for a while after it has been applied, as what was placed before
  /// stays as it was.
  [[nodiscard]] double unstated_factor() const;

  /// What is worth telling people.
  void list(std::vector<FoundMismatch>& out) const;

  /// The body has moved to an image.
  void follow(const MotionSinceImage& motion);
  /// What an image says. @param on_time  twist of the camera, W axes
  void learn(const StackedUpdate::SharedScore& said, const Vector6d& on_time);
  /// The image has corrected the body.
  void correct(const StackedUpdate::SharedScore& said, const Vector6d& on_time);

 private:
  enum Noise { kImu, kStamps };

  [[nodiscard]] Eigen::Matrix2d curvature() const;
  [[nodiscard]] double sigma_of(Noise noise) const;
  /// A score test at what is applied, in sigmas of a normal distribution.
  [[nodiscard]] double score_of(Noise noise) const;
  void apply_estimate();
  void weigh_anew();

  BodyMatrix P_;  ///< Of the body against tags at exact places …
  BodyMatrix D_;  ///< … and its derivative by the variance of the IMU.
  LearnedNoise now_;
  LearnedNoise earlier_;                       ///< As it was some images ago …
  LearnedNoise before_;                        ///< … and before those.
  std::optional<LearnedNoise> doubted_since_;  ///< As it was when images began to contradict.
  int images_since_earlier_{0};
  double suspected_{1.0};  ///< Variance of the IMU by all that is known, significant or not.
  double outgrown_{1.0};   ///< So much larger than what most was reckoned with is what is applied.
};

}  // namespace fiducap::world
