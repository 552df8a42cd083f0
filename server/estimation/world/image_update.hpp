#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/filter/stacked_update.hpp"
#include "estimation/start/place_search.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/world/calibration_monitor.hpp"
#include "estimation/world/filter_state.hpp"
#include "estimation/world/noise_watch.hpp"

namespace fiducap::world {

/// Suspends the tests for a while after a large change of the axes: until the filter has converged,
/// nonlinearity resembles a wrong lens or tag size.
class PostRealignmentHoldoff final {
 public:
  /// @param X_new_old  motion of a body that is at X_WB now
  void note(const Pose& X_new_old, const Pose& X_WB, Instant now) {
    const double moved_m = (X_WB.p - (X_new_old.inverse() * X_WB).p).norm();
    const bool is_far = moved_m > kFar_m || log_so3(X_new_old.q).norm() > kFar_rad;
    if (std::exchange(is_first_, false) || is_far) until_ = now + kLasts;
  }
  [[nodiscard]] bool active(Instant now) const { return now < until_; }

 private:
  static constexpr Duration kLasts = std::chrono::seconds(2);
  static constexpr double kFar_m = 0.1;
  static constexpr double kFar_rad = 0.02;

  bool is_first_{true};
  Instant until_{Instant::min()};
};

/// The update of RCARS II-D4 with all tags of one image jointly, optionally iterated. Keeps its
/// memory between images.
class CornerUpdate final {
 public:
  struct Options {
    GateLimits gate;
    int iterations{1};  ///< More than 1: iterated EKF, for a mean far from the corners.
    const FilterState* start{nullptr};  ///< First linearisation point; nullptr: the prior mean.
    bool wants_score{false};            ///< Computes shared_score(), which costs another division.
  };

  /// @param noise     of this camera's corners; learns from every tag
  /// @param accepted  out: per entry of `tags`, whether it was used
  UpdateReport apply(FilterState& state, int camera, const CameraModel& model,
                     std::span<const TagToUse> tags, const Options& options, CornerNoise& noise,
                     std::vector<bool>& accepted);

  /// Score of the camera's pose by the accepted tags of the last image; nullopt: none, or not
  /// wanted.
  [[nodiscard]] const std::optional<StackedUpdate::SharedScore>& shared_score() const {
    return score_;
  }

 private:
  FilterState prior_;  ///< mean only
  ImageMeasurement image_;
  StackedUpdate update_;
  std::optional<StackedUpdate::SharedScore> score_;
};

/// Corrects a state by the corners of one image, and learns noise and calibration from it.
class ImageUpdate final {
 public:
  /// Keeps references to both.
  ImageUpdate(const BodySensors& sensors, const EstimatorConfig& config);

  /// The state was reset: adds the calibration parameters.
  void restart(FilterState& state);
  /// Sets the lens and the applied clock shift of the present image.
  void look_at(FilterState& state, const TagObservations& seen);
  /// @param linearisation  first linearisation point; nullptr: the mean
  /// @param accepted       out: per tag
  UpdateReport correct(FilterState& state, FilterState* linearisation, const TagObservations& seen,
                       std::span<const TagToUse> tags, const GateLimits& gate, int iterations,
                       std::vector<bool>& accepted);
  /// Updates the tests of the configuration. Once per new image.
  void test(FilterState& state, const TagObservations& seen, const UpdateReport& report);
  /// Off while past images are processed again: they have taught already.
  void set_learning(bool is_learning) { is_learning_ = is_learning; }

  /// Estimates the noise of the motion to an image.
  void follow(const MotionSinceImage& motion) {
    if (watches_noise()) noise_watch_.follow(motion);
  }
  /// The motion is unknown, or expressed in other axes.
  void lose_motion() { noise_watch_.lose_motion(); }
  /// After an exchange with the map. @param before  statistics before it
  void follow_map(FilterState& state, const KnownMap& map, int body_id, const Pose& moved,
                  std::span<const CalibrationMonitor::TestStatistics> before);
  [[nodiscard]] const CalibrationMonitor& calibration() const { return calibration_monitor_; }

  [[nodiscard]] InitialisationPriors initialisation_priors(const FilterState& state) const;
  /// Jitter is applied from the first image that teaches noise: the clock must be known.
  void begin_with(FilterState& state, const InitialisationPriors& priors);
  /// Includes the covariance of likely, not yet corrected errors.
  [[nodiscard]] BodyEstimate body(const FilterState& state) const;
  [[nodiscard]] BodyPlace place(const FilterState& state) const;
  void list_mismatches(const FilterState& state, std::vector<FoundMismatch>& out) const {
    calibration_monitor_.list(state, out);
    noise_watch_.list(out);
  }
  [[nodiscard]] CornerNoise& noise(int camera) {
    return corner_noise_[static_cast<std::size_t>(camera)];
  }
  [[nodiscard]] const CornerNoise& noise(int camera) const {
    return corner_noise_[static_cast<std::size_t>(camera)];
  }
  [[nodiscard]] double imu_variance() const { return noise_watch_.imu_variance(); }
  [[nodiscard]] LearnedSensors learned(int camera) const {
    return {&noise(camera), noise_watch_.imu_variance(), noise_watch_.jitter_s()};
  }
  /// The lens of the present image.
  [[nodiscard]] const CameraModel& lens(int camera) const {
    return lenses_[static_cast<std::size_t>(camera)];
  }
  [[nodiscard]] std::vector<SightedTag> sighted(const FilterState& state, int camera,
                                                std::span<const TagToUse> tags) const;

 private:
  void apply_jitter(FilterState& state) const {
    for (CameraClock& clock : state.clocks) clock.jitter_s = noise_watch_.jitter_s();
  }
  [[nodiscard]] bool watches_noise() const;
  void learn_noise(FilterState& state, const UpdateReport& report, const Vector6d& on_time,
                   bool teaches);

  const BodySensors& sensors_;
  const EstimatorConfig& config_;
  CornerUpdate corner_update_;
  std::vector<CornerNoise> corner_noise_;  ///< One per camera.
  CalibrationMonitor calibration_monitor_;
  std::vector<CameraModel> lenses_;  ///< One per camera: as known before the present image.
  NoiseWatch noise_watch_;
  bool is_learning_{true};
  PostRealignmentHoldoff holdoff_;
  double nis_{1.0};  ///< Mean normalised innovation squared of the last images.
};

}  // namespace fiducap::world
