#pragma once

#include <optional>
#include <span>
#include <vector>

#include "estimation/filter/corner_update.hpp"
#include "estimation/robocentric/corner_measurement.hpp"
#include "estimation/robocentric/frame_transition.hpp"
#include "estimation/robocentric/propagation.hpp"
#include "estimation/robocentric/relink.hpp"
#include "estimation/robocentric/tag_augmentation.hpp"
#include "estimation/robocentric/workspace_axes.hpp"
#include "estimation/start/clock_hypothesis.hpp"

namespace fiducap::robocentric {

/// The state of RCARS II-D, body, biases, extrinsics and tags in the body's own axes, and what can
/// be done to it. What follows from it is decided by FilterConversation.
///
/// Kept from the paper: the state, the measurement, gravity-true up, tags and extrinsics estimated
/// online. Changed where the authors' code was measured to fail: exact rotation steps with
/// mid-point readings, no random walk on tags and extrinsics, all tags of an image in one update
/// gated on the joint covariance, any number of tags and cameras. The clocks are taken as one.
class RobocentricCoordinates final {
 public:
  static constexpr bool kStartsBeforeTags = false;
  static constexpr bool kRemembersImages = false;

  /// Both stay the caller's.
  RobocentricCoordinates(const BodySensors& sensors, const EstimatorConfig& config);

  [[nodiscard]] FilterState& state() { return state_; }
  [[nodiscard]] const FilterState& state() const { return state_; }
  [[nodiscard]] Pose X_WB() const { return state_.X_WB(); }
  /// place_search works in the body's axes of the state's instant: what it answers is the motion.
  [[nodiscard]] Pose X_AB() const { return {}; }
  [[nodiscard]] Pose X_AB_of(const Pose& X_WB) const { return state_.X_WB().inverse() * X_WB; }
  [[nodiscard]] Eigen::Vector3d v_B() const { return state_.v_WB_B; }
  [[nodiscard]] Eigen::Vector3d acceleration_W(const Eigen::Vector3d& f_B) const {
    return state_.q_WB * f_B;
  }
  [[nodiscard]] BodyEstimate body() const { return body_in_workspace(state_); }
  [[nodiscard]] ClockEstimate clock(int) const { return {}; }
  [[nodiscard]] LensEstimate lens(int) const { return {}; }
  [[nodiscard]] Matrix6d extrinsics_covariance(int camera) const {
    return state_.P().block<6, 6>(layout::extrinsics(camera), layout::extrinsics(camera));
  }
  [[nodiscard]] bool is_attitude_unknown() const { return false; }  // any turn is linear in B

  void reset(const ClockHypothesis& clocks);
  /// @param q_WB  nullopt: without IMU
  void start(Instant at, const std::optional<Eigen::Quaterniond>& q_WB);
  void open_clock(int, double) {}
  [[nodiscard]] static StartLessons lessons() { return {}; }
  void begin_with(const StartLessons&) {}
  void set_clock(int, double, double) {}

  void step(const InertialInput& input, double dt);
  void finish_motion() { transition_.apply(state_, motion_); }
  void lose_motion() { motion_.restart(); }
  /// The body is at X_AB now, its motion unknown.
  void jump(const Pose& X_AB, Instant at);

  /// See WorldCoordinates.
  void aim(const Pose& X_B0B, double dt);
  void finish_aimed_motion();
  [[nodiscard]] bool is_aimed() const { return linearisation_.has_value(); }
  void forget_aim() { linearisation_.reset(); }
  void take_back() { state_ = before_; }

  void look_at(const TagObservations&) {}
  /// The paper has no tags of a map in its state.
  void hold_map_tags(const TagObservations&, std::span<const KnownTag>, const KnownMap*, bool) {}
  void hold_one(const KnownTag&, const KnownMap*, Instant) {}
  /// The paper's filter keeps its tags.
  std::optional<Pose> follow_map(const KnownMap&, int) { return std::nullopt; }
  void give_to_map(std::size_t tag, const KnownTag& map);
  [[nodiscard]] bool is_own(std::size_t) const { return true; }
  [[nodiscard]] std::vector<SightedTag> sighted(int camera, std::span<const TagToUse> tags) const;
  [[nodiscard]] Pose place_in_W(const TagToUse& tag) const;

  UpdateReport correct(const TagObservations& seen, std::span<const TagToUse> tags, double gate,
                       int iterations, std::vector<bool>& accepted);
  void correct_by_points(const TagObservations&, long, UpdateReport&) {}
  void augment(const TagObservations& seen, const TagObservation& tag, const Pose& X_VT);
  void keep_defined(std::size_t tag, const HeadingRule& rule);
  void moved_axes(const Pose&) {}
  [[nodiscard]] BodyPlace place() const;
  [[nodiscard]] static double turn_sigma_rad() { return 0; }  // as in the paper
  [[nodiscard]] double speed_sigma_m_s() const { return 0; }  // remembers no first sights
  /// The paper believes its configuration.
  void doubt(const TagObservations&, const UpdateReport&) {}
  void list_mismatches(std::vector<FoundMismatch>&) const {}
  void convict_tag() {}

  [[nodiscard]] const CornerNoise& noise(int) const { return corner_noise_; }
  [[nodiscard]] LearnedSensors learned(int) const { return {.corners = &corner_noise_}; }
  [[nodiscard]] std::optional<Instant> needed_since() const { return std::nullopt; }
  void forget_past() {}
  void forget_first_sight(int) {}
  void forget_past_of(int) {}

 private:
  [[nodiscard]] const CameraModel& model_of(int camera) const {
    return sensors_.cameras[static_cast<std::size_t>(camera)].model;
  }

  const BodySensors& sensors_;
  const EstimatorConfig& config_;
  Eigen::Vector3d gravity_W_;
  FilterState
      state_;  ///< Always whole: body, tags and covariance at one instant, that of the last image.
  MotionSinceImage motion_;
  FrameTransition transition_;
  CornerUpdate<FilterState> corner_update_;
  CornerNoise corner_noise_;
  FilterState before_;
  std::optional<FilterState> linearisation_;
  Eigen::Matrix<double, layout::kBodySize, 1> aimed_off_;
};

}  // namespace fiducap::robocentric
