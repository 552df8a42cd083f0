#pragma once

#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "base/expected.hpp"
#include "estimation/filter/corner_update.hpp"
#include "estimation/start/place_search.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/world/calibration_monitor.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/filter_state.hpp"
#include "estimation/world/image_memory.hpp"
#include "estimation/world/landmarks.hpp"
#include "estimation/world/noise_watch.hpp"
#include "estimation/world/propagation.hpp"
#include "estimation/world/tag_entry.hpp"
#include "estimation/world/workspace_axes.hpp"

namespace fiducap::world {

/// State of the production filter and its operations, used by TagFilter. All in workspace axes W
/// with errors on the world's side (error_state.hpp), so that the pose of the workspace stays
/// unobservable. Tags of the map are held with the map's covariance (Schmidt).
class WorldCoordinates final {
 public:
  /// The motion is tracked from the first sighting of a tag.
  static constexpr bool kStartsBeforeTags = true;
  /// Past images are processed again when a tag joins late.
  static constexpr bool kRemembersImages = true;

  /// Keeps references to both.
  WorldCoordinates(const BodySensors& sensors, const EstimatorConfig& config);

  [[nodiscard]] FilterState& state() { return state_; }
  [[nodiscard]] const FilterState& state() const { return state_; }
  [[nodiscard]] Pose X_WB() const { return state_.X_WB; }
  /// The body in the axes A of find_place(), here W.
  [[nodiscard]] Pose X_AB() const { return state_.X_WB; }
  [[nodiscard]] Pose X_AB_of(const Pose& X_WB) const { return X_WB; }
  [[nodiscard]] Eigen::Vector3d v_B() const { return state_.X_WB.q.conjugate() * state_.v_WB; }
  [[nodiscard]] Eigen::Vector3d acceleration_W(const Eigen::Vector3d& f_B) const {
    return state_.X_WB.q * f_B;
  }
  /// Includes the covariance of likely, not yet corrected errors.
  [[nodiscard]] BodyEstimate body() const;
  [[nodiscard]] ClockEstimate clock(int camera) const;
  [[nodiscard]] Matrix6d extrinsics_covariance(int camera) const {
    return world::extrinsics_covariance(state_, camera);
  }
  [[nodiscard]] bool is_attitude_unknown() const;

  void reset(const ClockHypothesis& clocks);
  /// @param q_WB  nullopt: without IMU
  void start(Instant at, const std::optional<Eigen::Quaterniond>& q_WB);
  void open_clock(int camera, double sigma_s);
  /// Sets a clock after a jump and discards the noise learned from the last images.
  void set_clock(int camera, double shift_s, double sigma_s);

  void step(const InertialInput& input, double dt);
  /// Propagates the covariance over the steps since the last image.
  void finish_motion();
  void lose_motion();
  [[nodiscard]] BodyPlace place() const;
  /// Smallest attitude error relative to the workspace or a tag of this image; 1-sigma per axis.
  [[nodiscard]] double turn_sigma_rad() const;
  [[nodiscard]] double speed_sigma_m_s() const {
    return std::sqrt(state_.P().diagonal().segment<3>(layout::kVelocity).sum());
  }
  /// Sets the body to X_AB, motion unknown.
  void jump(const Pose& X_AB, Instant at);
  /// Without IMU: linearises the motion at the velocity and rate that lead to X_B0B in dt.
  void aim(const Pose& X_B0B, double dt);
  /// After the steps: restores the prior mean.
  void finish_aimed_motion();
  [[nodiscard]] bool is_aimed() const { return linearisation_.has_value(); }
  void forget_aim() { linearisation_.reset(); }
  /// Restores the state before aim().
  void take_back() { state_ = before_; }

  void look_at(const TagObservations& seen);
  /// See HeldTags::follow().
  void hold_map_tags(const TagObservations& seen, std::span<const KnownTag> known,
                     const KnownMap* whole, bool is_anchored) {
    held_tags_.follow(state_, seen, known, whole, is_anchored);
  }
  void hold_one(const KnownTag& tag, const KnownMap* whole, Instant at) {
    world::hold_one(state_, tag, whole, at);
  }
  /// After a change of the map: see exchange().
  std::optional<Pose> follow_map(const KnownMap& map, int body_id);
  /// Fuses an own tag with the map's, which replaces it.
  void give_to_map(std::size_t tag, const KnownTag& map);
  /// False: a tag of the map.
  [[nodiscard]] bool is_own(std::size_t tag) const { return !state_.tags[tag].held; }
  [[nodiscard]] std::vector<SightedTag> sighted(int camera, std::span<const TagToUse> tags) const;
  [[nodiscard]] Pose place_in_W(const TagToUse& tag) const { return place_of(state_, tag); }

  UpdateReport correct(const TagObservations& seen, std::span<const TagToUse> tags, double gate,
                       int iterations, std::vector<bool>& accepted);
  void correct_by_points(const TagObservations& seen, long image, UpdateReport& report);
  /// Updates the tests of the configuration. Once per new image.
  void doubt(const TagObservations& seen, const UpdateReport& report);
  void list_mismatches(std::vector<FoundMismatch>& out) const {
    calibration_monitor_.list(state_, out);
    noise_watch_.list(out);
  }
  /// Open parameters of a camera's lens.
  [[nodiscard]] LensEstimate lens(int camera) const {
    return calibration_monitor_.lens(state_, camera);
  }
  /// Off while past images are processed again: they have taught already.
  void set_learning(bool is_learning) { is_learning_ = is_learning; }
  /// A tag was wrong, not the noise.
  void discard_noise_learned_since_outlier() {
    noise_watch_.discard_since_outlier();
    apply_jitter();
  }
  [[nodiscard]] InitialisationPriors initialisation_priors() const;
  /// Jitter is applied from the first image that teaches noise: the clock must be known.
  void begin_with(const InitialisationPriors& priors);
  void augment(const TagObservations& seen, const TagObservation& tag, const Pose& X_VT);
  /// Removes the slip of the reference tag due to linearisation.
  void keep_defined(std::size_t tag, const HeadingRule& rule);
  void moved_axes(const Pose& X_new_old);

  [[nodiscard]] const CornerNoise& noise(int camera) const {
    return corner_noise_[static_cast<std::size_t>(camera)];
  }
  [[nodiscard]] LearnedSensors learned(int camera) const {
    return {&noise(camera), noise_watch_.imu_variance(), noise_watch_.jitter_s()};
  }
  [[nodiscard]] ImageMemory& memory() { return memory_; }
  [[nodiscard]] std::optional<Instant> needed_since() const { return memory_.needed_since(); }
  void forget_past() { memory_.forget_all(); }
  void forget_first_sight(int tag_id) { memory_.stop_waiting(tag_id); }
  void forget_past_of(int tag_id) { memory_.forget_tag(tag_id); }

 private:
  [[nodiscard]] const CameraModel& model_of(int camera) const {
    FIDUCAP_ASSERT(camera >= 0 && camera < static_cast<int>(sensors_.cameras.size()));
    return sensors_.cameras[static_cast<std::size_t>(camera)].model;
  }
  void apply_jitter() {
    for (CameraClock& clock : state_.clocks) clock.jitter_s = noise_watch_.jitter_s();
  }
  [[nodiscard]] bool watches_noise() const;
  void reset_camera(int camera, const ClockHypothesis& clocks);

  const BodySensors& sensors_;
  const EstimatorConfig& config_;
  Eigen::Vector3d gravity_W_;
  FilterState state_;  ///< Mean and covariance at the instant of the last image.
  MotionSinceImage motion_;
  CornerUpdate<FilterState> corner_update_;
  std::vector<CornerNoise> corner_noise_;  ///< One per camera.
  CalibrationMonitor calibration_monitor_;
  std::vector<CameraModel> lenses_;  ///< One per camera: as known before the present image.
  NoiseWatch noise_watch_;
  bool is_learning_{true};
  int images_without_fit_{0};  ///< Consecutive.
  PostRealignmentHoldoff holdoff_;
  double nis_{1.0};  ///< Mean normalised innovation squared of the last images.
  ImageMemory memory_;
  std::optional<CloneWindow> window_;  ///< Only when points are tracked.
  HeldTags held_tags_;
  FilterState before_;
  std::optional<FilterState> linearisation_;
  Eigen::Matrix<double, layout::kBodySize, 1> aimed_off_;
};

}  // namespace fiducap::world
