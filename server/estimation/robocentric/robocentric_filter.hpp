#pragma once

#include <optional>
#include <span>
#include <vector>

#include "estimation/filter/corner_update.hpp"
#include "estimation/robocentric/filter_state.hpp"
#include "estimation/robocentric/motion.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/update/tag_filter.hpp"

namespace fiducap::robocentric {

/// State of RCARS II-D (body, biases, extrinsics and tags in the body's own axes) and its
/// operations, used by TagFilter.
///
/// As in the paper: state, measurement, vertical by gravity, online estimation of tags and
/// extrinsics. Different, where the authors' code failed in measurements: exact rotation steps with
/// mid-point samples, no random walk on tags and extrinsics, joint update and gating of all tags of
/// an image, any number of tags and cameras. All clocks are equal.
class RobocentricCoordinates final {
 public:
  static constexpr bool kStartsBeforeTags = false;
  static constexpr bool kRemembersImages = false;

  /// Keeps references to both.
  RobocentricCoordinates(const BodySensors& sensors, const EstimatorConfig& config);

  [[nodiscard]] FilterState& state() { return state_; }
  [[nodiscard]] const FilterState& state() const { return state_; }
  [[nodiscard]] Pose X_WB() const { return state_.X_WB(); }
  /// find_place() works in the body axes A at the state's instant: it returns the motion since.
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
  [[nodiscard]] bool is_attitude_unknown() const { return false; }  // rotation is linear in B

  void reset(const ClockHypothesis& clocks);
  /// @param q_WB  nullopt: without IMU
  void start(Instant at, const std::optional<Eigen::Quaterniond>& q_WB);
  void open_clock(int, double) {}
  [[nodiscard]] static InitialisationPriors initialisation_priors() { return {}; }
  void begin_with(const InitialisationPriors&) {}
  void set_clock(int, double, double) {}

  void step(const InertialInput& input, double dt) {
    robocentric::propagate(state_, motion_, input, gravity_W_, dt);
  }
  void finish_motion() { transition_.apply(state_, motion_); }
  void lose_motion() { motion_.restart(); }
  /// Sets the body to X_AB, motion unknown.
  void jump(const Pose& X_AB, Instant at);

  /// See WorldCoordinates.
  void aim(const Pose& X_B0B, double dt);
  void finish_aimed_motion();
  [[nodiscard]] bool is_aimed() const { return linearisation_.has_value(); }
  void forget_aim() { linearisation_.reset(); }
  void take_back() { state_ = before_; }

  void look_at(const TagObservations&) {}
  /// RCARS has no map tags in its state.
  void hold_map_tags(const TagObservations&, std::span<const KnownTag>, const KnownMap*, bool) {}
  void hold_one(const KnownTag&, const KnownMap*, Instant) {}
  std::optional<Pose> follow_map(const KnownMap&, int) { return std::nullopt; }
  void give_to_map(std::size_t tag, const KnownTag& map) {
    fuse_prior(state_, tag, map);
    state_.remove_tag(tag);
  }
  [[nodiscard]] bool is_own(std::size_t) const { return true; }
  [[nodiscard]] std::vector<SightedTag> sighted(int camera, std::span<const TagToUse> tags) const {
    return tags_at_start(state_, camera, model_of(camera), tags);
  }
  [[nodiscard]] Pose place_in_W(const TagToUse& tag) const {
    if (tag.local < 0) return tag.known->X_WT;
    return state_.X_WB() * state_.X_BV[0] * state_.tags[static_cast<std::size_t>(tag.local)].X_VT;
  }

  UpdateReport correct(const TagObservations& seen, std::span<const TagToUse> tags, double gate,
                       int iterations, std::vector<bool>& accepted);
  void correct_by_points(const TagObservations&, long, UpdateReport&) {}
  void augment(const TagObservations& seen, const TagObservation& tag, const Pose& X_VT) {
    robocentric::augment(state_, seen.camera, model_of(seen.camera), tag, X_VT,
                         config_.corner_noise_px);
  }
  void keep_defined(std::size_t tag, const HeadingRule& rule) {
    anchor_to_reference(state_, tag, rule, sensors_.imu.has_value());
  }
  void moved_axes(const Pose&) {}
  [[nodiscard]] BodyPlace place() const {
    const BodyEstimate now = body();
    return {now.X_WB.p, now.covariance.topLeftCorner<3, 3>()};
  }
  [[nodiscard]] static double turn_sigma_rad() { return 0; }  // as in RCARS
  [[nodiscard]] double speed_sigma_m_s() const { return 0; }
  /// The configuration is not tested.
  void doubt(const TagObservations&, const UpdateReport&) {}
  void list_mismatches(std::vector<FoundMismatch>&) const {}
  void discard_noise_learned_since_outlier() {}

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
  FilterState state_;  ///< At the instant of the last image.
  MotionSinceImage motion_;
  FrameTransition transition_;
  CornerUpdate<FilterState> corner_update_;
  CornerNoise corner_noise_;
  FilterState before_;
  std::optional<FilterState> linearisation_;
  Eigen::Matrix<double, layout::kBodySize, 1> aimed_off_;
};

/// The filter of RCARS II-D. Without IMU the same equations use white noise acceleration and
/// angular acceleration; the body rate is then −bias_w.
using RobocentricFilter = TagFilter<RobocentricCoordinates>;

}  // namespace fiducap::robocentric

namespace fiducap {
extern template class TagFilter<robocentric::RobocentricCoordinates>;
}
