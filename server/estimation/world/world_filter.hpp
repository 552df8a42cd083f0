#pragma once

#include <map>
#include <optional>
#include <vector>

#include "estimation/body_filter.hpp"
#include "estimation/filter/corner_update.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/filter/tag_scores.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/start/attitude_start.hpp"
#include "estimation/start/place_search.hpp"
#include "estimation/start/tag_candidates.hpp"
#include "estimation/world/clone_window.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/filter_state.hpp"
#include "estimation/world/image_memory.hpp"
#include "estimation/world/propagation.hpp"
#include "estimation/world/start_log.hpp"

namespace fiducap::world {

/// The production filter: the measurements of RCARS II-D4, the state in workspace axes W.
///
/// Errors stand on the world's side (state_layout.hpp), so that where the room is never becomes
/// observable by mistake and the filter stays consistent over long loops. Tags of the map are held
/// with the map's covariance (Schmidt), tags of its own are estimated. Without IMU the motion is a
/// white noise acceleration and angular acceleration; the body rate is then −bias_w, and each image
/// is linearised at the motion its own tags show.
class WorldFilter final : public BodyFilter {
 public:
  WorldFilter(BodySensors sensors, WorkspaceGauge gauge, EstimatorConfig config);

  void propagate(const ImuSample& imu) override;
  UpdateReport update(const TagObservations& seen, const MapKnowledge& map) override;
  void set_tag_priors(std::vector<KnownTag> priors) override;
  void lose_motion() override;
  void release_tag(int tag_id) override;
  [[nodiscard]] bool running() const override;
  [[nodiscard]] BodyEstimate estimate() const override;
  void tag_beliefs(std::vector<TagBelief>& out) const override;
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override;
  [[nodiscard]] ClockEstimate clock(int camera) const override;

  [[nodiscard]] const FilterState& state() const { return state_; }

 private:
  enum class Mode {
    kStarting,  ///< No tags yet, no pose.
    kAdrift,    ///< Tags and workspace are known, the motion since then is not.
    kRunning,
  };
  /// Those that poses were given out in.
  struct Axes {
    bool are_anchored{};
    std::optional<int> gauge_tag;
  };

  [[nodiscard]] bool has_imu() const { return sensors_.imu.has_value(); }
  [[nodiscard]] const CameraModel& model_of(int camera) const;
  void restart();
  void restart_camera(int camera);
  void open_clock(int camera, double sigma_s);
  void reopen_clock(int camera);
  void begin_log();
  void log_start(const TagObservations& seen, std::span<const KnownTag> known);
  [[nodiscard]] double first_shift_of(std::size_t camera) const;
  [[nodiscard]] StartLife first_guess(double spread) const;
  [[nodiscard]] double cost_of_shifts() const;
  [[nodiscard]] bool clock_was_far_off(const StartLife& guess) const;
  void charge(const TagObservations& seen, const UpdateReport& report);
  UpdateReport relive_start_if_due(const UpdateReport& report, const Axes& before);
  UpdateReport live_best_start(const UpdateReport& report, const Axes& before);
  UpdateReport live_refined(StartLife guess, StartLife& best, const UpdateReport& report);
  [[nodiscard]] StartLife search_shift(const UpdateReport& report);
  UpdateReport live_start(const StartLife& guess, const UpdateReport& report);
  UpdateReport process(const TagObservations& seen, std::span<const KnownTag> known);
  void look_at(const TagObservations& seen);
  void start(Instant at);
  void integrate_to(Instant to);
  void step_to(Instant to, const InertialInput& input, double longest_s);

  void follow_map(const TagObservations& seen, std::span<const KnownTag> known);
  void hold_map_tags(const TagObservations& seen, std::span<const KnownTag> known);
  void anchor_by_own_tags(std::span<const KnownTag> known, UpdateReport& report);
  void sort_tags(const TagObservations& seen, std::span<const KnownTag> known);
  [[nodiscard]] std::vector<SightedTag> sighted(int camera) const;
  void answer_contradictions(const TagObservations& seen);
  bool move_to(const TagObservations& seen);
  bool move_by_corners(const TagObservations& seen);
  [[nodiscard]] bool has_turned_blindly() const;
  [[nodiscard]] bool is_one_tag_against_all() const;
  bool come_back(const TagObservations& seen);
  /// One tag whose views since, compared with the gyro, decide its branch.
  bool come_back_by_views(const TagObservations& seen);
  void jump(const Pose& X_WB, Instant at);
  void correct(const TagObservations& seen, UpdateReport& report, int iterations);
  void score(UpdateReport& report);
  void correct_by_points(const TagObservations& seen, long image, UpdateReport& report);
  void meet_fresh_tags(const TagObservations& seen, UpdateReport& report);
  [[nodiscard]] Pose near_place(const TagObservation& seen, int camera,
                                const Eigen::Quaterniond& q_VT) const;
  bool admit_late(const TagToUse& tag, const TagVerdict& verdict, UpdateReport& report);
  void live_again(long from, UpdateReport& report);
  void join(const TagObservations& seen, const ImageMemory::Admission& admission);
  bool admit(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
             UpdateReport& report);
  bool admit_adrift(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT);
  void admit_known(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                   UpdateReport& report);
  void anchor_at(int camera, const Pose& X_VT, const Pose& X_WT, UpdateReport& report);
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
      state_;  ///< Always whole: mean and covariance at one instant, that of the last image.
  MotionSinceImage motion_;
  CornerUpdate<FilterState> corner_update_;
  std::vector<CornerNoise> corner_noise_;  ///< One per camera.
  StartLife life_;                         ///< How the present start is lived.
  StartLog start_log_;
  int vain_searches_{0};           ///< For another clock, since a start was last explained well.
  std::size_t due_looks_{0};       ///< At the log, since it began …
  std::size_t strained_looks_{0};  ///< … and those because images contradicted each other.
  bool reliving_{false};
  AttitudeStart attitude_;
  TagCandidates candidates_;
  ImageMemory memory_;
  std::optional<CloneWindow> window_;  ///< Only when points are followed.
  ImuBuffer imu_;
  std::optional<HeadingRule> heading_rule_;
  std::optional<int> gauge_tag_;  ///< Defined W; while it is in the state it stays where it was.
  TagScores scores_;
  std::map<int, KnownTag> priors_;
  bool may_define_workspace_{true};  ///< See MapKnowledge.
  int generation_{0};

  std::vector<TagToUse> usable_;  ///< Tags of the present image that correct the state …
  std::vector<TagToUse> fresh_;   ///< … and those that may join it.
  std::vector<std::pair<TagToUse, TagVerdict>>
      decided_;  ///< Those of them whose branch is certain now.
  std::vector<bool> accepted_;
  std::optional<FilterState> linearisation_;
  FilterState before_;  ///< Without IMU: the state before the present image.
  std::optional<Instant> last_used_at_;
  int barren_updates_{0};         ///< In a row: tags to use, none accepted.
  int strained_updates_{0};       ///< In a row: at least half of the tags not accepted.
  int return_attempts_{0};        ///< Images since adrift that showed a usable tag.
  bool is_attitude_lost_{false};  ///< Adrift, and the gyro does not say how the body turned since.
};

}  // namespace fiducap::world
