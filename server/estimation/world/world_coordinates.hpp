#pragma once

#include <optional>
#include <span>
#include <vector>

#include "estimation/filter/corner_update.hpp"
#include "estimation/start/clock_hypothesis.hpp"
#include "estimation/start/resection.hpp"
#include "estimation/world/axes_unrest.hpp"
#include "estimation/world/clone_window.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/filter_state.hpp"
#include "estimation/world/held_tags.hpp"
#include "estimation/world/image_memory.hpp"
#include "estimation/world/noise_watch.hpp"
#include "estimation/world/propagation.hpp"
#include "estimation/world/suspects.hpp"
#include "estimation/world/workspace_axes.hpp"

namespace fiducap::world {

/// The production filter's state and what can be done to it: everything in workspace axes W, errors
/// on the world's side (state_layout.hpp), so that where the room is never becomes observable by
/// mistake. Tags of the map are held with the map's covariance (Schmidt). What follows from it is
/// decided by FilterConversation.
class WorldCoordinates final {
 public:
  /// The motion is followed from the first sight of a tag on.
  static constexpr bool kStartsBeforeTags = true;
  /// Past images are followed again when a tag joins late.
  static constexpr bool kRemembersImages = true;

  /// Both stay the caller's.
  WorldCoordinates(const BodySensors& sensors, const EstimatorConfig& config);

  [[nodiscard]] FilterState& state() { return state_; }
  [[nodiscard]] const FilterState& state() const { return state_; }
  [[nodiscard]] Pose X_WB() const { return state_.X_WB; }
  /// The body at the state's instant in the axes that place_search works in, and back.
  [[nodiscard]] Pose X_AB() const { return state_.X_WB; }
  [[nodiscard]] Pose X_AB_of(const Pose& X_WB) const { return X_WB; }
  [[nodiscard]] Eigen::Vector3d v_B() const { return state_.X_WB.q.conjugate() * state_.v_WB; }
  [[nodiscard]] Eigen::Vector3d acceleration_W(const Eigen::Vector3d& f_B) const;
  /// As unsure as what is suspected would make it, before that is certain enough to be corrected.
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
  /// It has jumped: what the last images taught of noises was its error.
  void set_clock(int camera, double shift_s, double sigma_s);

  void step(const InertialInput& input, double dt);
  /// Moves the covariance over the steps since the last image.
  void finish_motion();
  void lose_motion();
  [[nodiscard]] BodyPlace place() const;
  /// Against the workspace or a tag of this image, what tells it best; 1-sigma per axis.
  [[nodiscard]] double turn_sigma_rad() const;
  [[nodiscard]] double speed_sigma_m_s() const;
  /// The body is at X_AB now, its motion unknown.
  void jump(const Pose& X_AB, Instant at);
  /// Without IMU: the motion is linearised where velocity and rate lead to X_B0B in dt …
  void aim(const Pose& X_B0B, double dt);
  /// … and after the steps the prior mean is where the old ones would have led.
  void finish_aimed_motion();
  [[nodiscard]] bool is_aimed() const { return linearisation_.has_value(); }
  void forget_aim() { linearisation_.reset(); }
  void take_back() { state_ = before_; }  ///< As it was before aim().

  void look_at(const TagObservations& seen);
  /// Takes over what the map says of tags in view and of those held.
  void hold_map_tags(const TagObservations&, std::span<const KnownTag> known, const KnownMap* whole,
                     bool is_anchored);
  void hold_one(const KnownTag& tag, const KnownMap* whole, Instant at);
  /// The map has learned: see exchange().
  std::optional<Pose> follow_map(const KnownMap& map, int body_id);
  /// The tag's own copy becomes the map's, and what both say is fused.
  void give_to_map(std::size_t tag, const KnownTag& map);
  /// A tag of the map is not a belief of this body.
  [[nodiscard]] bool is_own(std::size_t tag) const { return !state_.tags[tag].held; }
  [[nodiscard]] std::vector<SightedTag> sighted(int camera, std::span<const TagToUse> tags) const;
  [[nodiscard]] Pose place_in_W(const TagToUse& tag) const { return place_of(state_, tag); }

  UpdateReport correct(const TagObservations& seen, std::span<const TagToUse> tags, double gate,
                       int iterations, std::vector<bool>& accepted);
  void correct_by_points(const TagObservations& seen, long image, UpdateReport& report);
  /// Looks whether what the image said accuses the configuration. Once per image, when it is new.
  void doubt(const TagObservations& seen, const UpdateReport& report);
  void list_mismatches(std::vector<FoundMismatch>& out) const;
  /// A camera's lens, as far as it is estimated.
  [[nodiscard]] LensEstimate lens(int camera) const { return suspects_.lens(state_, camera); }
  /// While past images are followed again nothing is learned of noises: they have said it already.
  void set_learning(bool is_learning) { is_learning_ = is_learning; }
  /// A tag was wrong where images contradicted: that was no noise.
  void convict_tag();
  [[nodiscard]] StartLessons lessons() const;
  /// Jitter counts from the first image on that teaches of it: a clock must be known before.
  void begin_with(const StartLessons& lessons);
  void augment(const TagObservations& seen, const TagObservation& tag, const Pose& X_VT);
  /// Takes back what linearisation let the tag slip that W was defined by.
  void keep_defined(std::size_t tag, const HeadingRule& rule);
  void moved_axes(const Pose& X_new_old);

  [[nodiscard]] const CornerNoise& noise(int camera) const;
  [[nodiscard]] LearnedSensors learned(int camera) const;
  [[nodiscard]] ImageMemory& memory() { return memory_; }
  [[nodiscard]] std::optional<Instant> needed_since() const { return memory_.needed_since(); }
  void forget_past() { memory_.forget_all(); }
  void forget_first_sight(int tag_id) { memory_.stop_waiting(tag_id); }
  void forget_past_of(int tag_id) { memory_.forget_tag(tag_id); }

 private:
  [[nodiscard]] const CameraModel& model_of(int camera) const;
  [[nodiscard]] Suspects::Rules doubts() const;
  void apply_jitter();
  void note_fit(bool fits);
  [[nodiscard]] bool watches_noise() const;
  void reset_camera(int camera, const ClockHypothesis& clocks);

  const BodySensors& sensors_;
  const EstimatorConfig& config_;
  Eigen::Vector3d gravity_W_;
  FilterState state_;  ///< Always whole: mean and covariance at the instant of the last image.
  MotionSinceImage motion_;
  CornerUpdate<FilterState> corner_update_;
  std::vector<CornerNoise> corner_noise_;  ///< One per camera.
  Suspects suspects_;
  std::vector<CameraModel> lenses_;  ///< One per camera: as it was known before the present image.
  NoiseWatch noise_watch_;
  bool is_learning_{true};
  int images_without_fit_{0};  ///< In a row.
  AxesUnrest unrest_;
  double nis_{1.0};  ///< Innovations squared over what was expected, of the last images.
  ImageMemory memory_;
  std::optional<CloneWindow> window_;  ///< Only when points are followed.
  HeldTags held_tags_;
  FilterState before_;
  std::optional<FilterState> linearisation_;
  Eigen::Matrix<double, layout::kBodySize, 1> aimed_off_;
};

}  // namespace fiducap::world
