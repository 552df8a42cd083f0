#pragma once

#include <map>
#include <optional>
#include <vector>

#include "estimation/body_filter.hpp"
#include "estimation/filter/corner_update.hpp"
#include "estimation/filter/tag_scores.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/robocentric/corner_measurement.hpp"
#include "estimation/robocentric/frame_transition.hpp"
#include "estimation/robocentric/propagation.hpp"
#include "estimation/robocentric/relink.hpp"
#include "estimation/robocentric/workspace_axes.hpp"
#include "estimation/start/attitude_start.hpp"
#include "estimation/start/tag_candidates.hpp"

namespace fiducap::robocentric {

/// The filter of RCARS II-D: body, biases, extrinsics and tags in the body's own axes, corrected by
/// tag corners.
///
/// Kept from the paper: the state, the measurement, gravity-true up, tags and extrinsics estimated
/// online. Changed where the authors' code was measured to fail: exact rotation steps with
/// mid-point readings, tags join only when their pose branch is certain, no random walk on tags and
/// extrinsics, all tags of an image in one update gated on the joint covariance, any number of tags
/// and cameras.
///
/// Without IMU the same equations run with a white noise acceleration and angular acceleration; the
/// body rate is then −bias_w, and each image is linearised at the motion its own tags show.
class RobocentricFilter final : public BodyFilter {
 public:
  RobocentricFilter(BodySensors sensors, WorkspaceGauge gauge, EstimatorConfig config);

  void propagate(const ImuSample& imu) override;
  UpdateReport update(const TagObservations& seen, const MapKnowledge& map) override;
  void set_tag_priors(std::vector<KnownTag> priors) override;
  void lose_motion() override;
  /// The paper keeps its tags.
  void release_tag(int) override {}
  [[nodiscard]] bool running() const override { return mode_ == Mode::kRunning; }
  [[nodiscard]] BodyEstimate estimate() const override;
  void tag_beliefs(std::vector<TagBelief>& out) const override;
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override;
  /// The paper takes the clocks as one.
  [[nodiscard]] ClockEstimate clock(int) const override { return {}; }

  [[nodiscard]] const FilterState& state() const { return state_; }

 private:
  enum class Mode {
    kStarting,  ///< No tags yet, no pose.
    kAdrift,    ///< Tags and workspace are known, the motion since then is not.
    kRunning,
  };

  [[nodiscard]] bool has_imu() const { return sensors_.imu.has_value(); }
  [[nodiscard]] const CameraModel& model_of(int camera) const;
  void restart();
  void start(Instant at);
  void integrate_to(Instant to);
  void step_to(Instant to, const InertialInput& input, double longest_s);

  void sort_tags(const TagObservations& seen, std::span<const KnownTag> known);
  bool move_to(const TagObservations& seen);
  bool move_by_corners(const TagObservations& seen);
  bool come_back(const TagObservations& seen);
  void jump(const Pose& X_B0B, Instant at);
  void correct(const TagObservations& seen, UpdateReport& report, int iterations);
  void score(UpdateReport& report);
  void anchor_by_own_tags(std::span<const KnownTag> known, UpdateReport& report);
  void meet_fresh_tags(const TagObservations& seen, UpdateReport& report);
  bool admit(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
             UpdateReport& report);
  void apply_priors(int camera, int tag_id, const Pose& X_VT, UpdateReport& report);
  void tie_workspace(UpdateReport& report);
  void shift_workspace(const Pose& X_new_old, UpdateReport& report);
  [[nodiscard]] std::optional<CameraAttitude> camera_attitude(int camera, Instant at) const;

  BodySensors sensors_;
  WorkspaceGauge gauge_;
  EstimatorConfig config_;
  double gate_;
  Eigen::Vector3d gravity_W_;

  Mode mode_{Mode::kStarting};
  bool is_anchored_{false};  ///< W is the workspace, for good: nothing defines it again.
  FilterState
      state_;  ///< Always whole: body, tags and covariance at one instant, that of the last image.
  MotionSinceImage motion_;
  FrameTransition transition_;
  CornerUpdate<FilterState> corner_update_;
  CornerNoise corner_noise_{config_, false};
  AttitudeStart attitude_;
  TagCandidates candidates_;
  ImuBuffer imu_;
  std::optional<HeadingRule> heading_rule_;
  std::optional<int> gauge_tag_;  ///< Defined W; while it is in the state it stays where it was.
  TagScores scores_;
  std::map<int, KnownTag> priors_;
  bool may_define_workspace_{true};  ///< See MapKnowledge.
  int generation_{0};

  std::vector<TagToUse> usable_;  ///< Tags of the present image that correct the state …
  std::vector<TagToUse> fresh_;   ///< … and those that may join it.
  std::vector<bool> accepted_;
  std::optional<FilterState> linearisation_;
  FilterState before_;  ///< Without IMU: the state before the present image.
  std::optional<Instant> last_used_at_;
  int barren_updates_{0};   ///< In a row: tags to use, none accepted.
  int return_attempts_{0};  ///< Images since adrift that showed a usable tag.
};

}  // namespace fiducap::robocentric
