#pragma once

#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "estimation/start/jump_search.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/update/contradictions.hpp"
#include "estimation/update/pose_finder.hpp"
#include "estimation/world/image_memory.hpp"
#include "estimation/world/image_update.hpp"
#include "estimation/world/landmarks.hpp"
#include "estimation/world/propagation.hpp"
#include "estimation/world/tag_entry.hpp"
#include "estimation/world/workspace_axes.hpp"

namespace fiducap {

/// The tags of one image. Reused between images to avoid allocations.
struct ImageTags {
  std::vector<TagToUse> usable;  ///< Correct the state.
  std::vector<TagToUse> fresh;   ///< May join the state.
  std::vector<bool> accepted;    ///< Per usable one, by the last update.

  /// @param is_anchored  the map's poses are in this filter's axes
  void sort(const TagObservations& seen, std::span<const KnownTag> known,
            const world::FilterState& state, bool is_anchored);
  /// Updates the indices after tags were removed from the state.
  void find_again(const world::FilterState& state);
};

/// The extended Kalman filter of one body: propagates, associates, gates, corrects. Adds new tags,
/// defines the workspace, removes outliers, relocalises and restarts.
///
/// The state is in workspace axes W with errors on the world's side (error_state.hpp), so that the
/// pose of the workspace stays unobservable. Tags of the map are held with the map's covariance
/// (Schmidt).
class TagFilter final : public StartingFilter {
 public:
  /// @param clocks  of the first start
  TagFilter(BodySensors sensors, const WorkspaceGauge& gauge, const EstimatorConfig& config,
            ClockHypothesis clocks);
  TagFilter(const TagFilter&) = delete;
  TagFilter& operator=(const TagFilter&) = delete;

  void propagate(const ImuSample& imu) override;
  UpdateReport update(const TagObservations& seen, const MapKnowledge& map) override;
  void set_tag_priors(std::vector<KnownTag> priors) override;
  void lose_motion() override { lose_motion(false); }
  void note_clock_jump(int camera, double shift_s, double sigma_s) override;
  [[nodiscard]] bool running() const override;
  [[nodiscard]] BodyEstimate estimate() const override;
  void tag_beliefs(std::vector<TagBelief>& out) const override;
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override;
  [[nodiscard]] ClockEstimate clock(int camera) const override { return clock_of(state_, camera); }
  void mismatches(std::vector<FoundMismatch>& out) const override;
  [[nodiscard]] LearnedSensors learned(int camera) const override {
    return image_update_.learned(camera);
  }

  [[nodiscard]] Explanation explain(const TagObservations& seen,
                                    const UpdateReport& report) const override;
  [[nodiscard]] bool is_following() const override { return mode_ == FilterMode::kRunning; }
  [[nodiscard]] int contradicting_images() const override {
    return contradictions_.contradicting_images();
  }
  [[nodiscard]] InitialisationPriors initialisation_priors() const override {
    return image_update_.initialisation_priors(state_);
  }
  void begin_with(const InitialisationPriors& priors) override {
    image_update_.begin_with(state_, priors);
  }
  void end_start() override;
  [[nodiscard]] Axes axes() const override { return {anchor_.is_anchored(), anchor_.defined_by()}; }
  [[nodiscard]] int generation() const override { return generation_; }
  void set_generation(int generation) override { generation_ = generation; }
  void set_restart_clocks(ClockHypothesis clocks) override { restart_clocks_ = std::move(clocks); }

  [[nodiscard]] const world::FilterState& state() const { return state_; }

 private:
  enum class FilterMode {
    kStarting,  ///< No tags yet, no pose.
    kLost,      ///< Tags and workspace are known, the motion since then is not.
    kRunning,
  };

  [[nodiscard]] bool has_imu() const { return sensors_.imu.has_value(); }
  [[nodiscard]] const CameraModel& model_of(int camera) const;
  /// Own tags are not the map's.
  [[nodiscard]] bool is_own(std::size_t tag) const { return !state_.tags[tag].held; }

  [[nodiscard]] bool has_made(const MapKnowledge& map) const;
  void restart();
  UpdateReport process(const TagObservations& seen, std::span<const KnownTag> known);
  /// Applies changes of the map and tests whether the body is lost.
  void predict(const TagObservations& seen, std::span<const KnownTag> known, UpdateReport& report);
  void follow_map(UpdateReport& report);
  void sort(const TagObservations& seen, std::span<const KnownTag> known);
  /// @return iterations of the update; 0: the state is not at this image
  int move_to(const TagObservations& seen);
  UpdateReport correct(const TagObservations& seen, int iterations);
  void correct(const TagObservations& seen, int iterations, UpdateReport& report);
  void correct_by_points(const TagObservations& seen, long image, UpdateReport& report);
  void shift_axes(const std::optional<Pose>& X_new_old, UpdateReport& report);
  void note_exact_tags();
  void add_bend_of_prints(BodyEstimate& body) const;

  // tag_filter_motion.cpp
  bool add_reading(const ImuSample& imu);
  void start_motion(Instant at);
  void lose_motion(bool is_turn_lost);
  void jump(const Pose& X_WB, Instant at);
  [[nodiscard]] bool propagate_to(const TagObservations& seen);
  [[nodiscard]] bool move_by_corners(const TagObservations& seen);
  void integrate_to(Instant to);
  void finish_motion();
  [[nodiscard]] std::optional<CameraAttitude> camera_attitude(int camera, Instant at) const;
  [[nodiscard]] double turn_sigma_rad() const;
  [[nodiscard]] std::optional<Eigen::Vector3d> shift_by(const TagObservations& seen,
                                                        const TagToUse& tag) const;

  // relocalisation.cpp
  void set_clock(int camera, double shift_s, double sigma_s);
  void reset_outlier_counters();
  void look_for_jump(const TagObservations& seen, UpdateReport& report);
  void handle_outliers(const TagObservations& seen, UpdateReport& report);
  void begin_relocalisation(const TagObservations& seen, UpdateReport& report);
  [[nodiscard]] bool is_proven(const TagToUse& tag) const;
  void discard_tag(int tag_id, Instant at, UpdateReport& report);
  void weigh_places(const TagObservations& seen, UpdateReport& report);
  void note_place_fit(const TagObservations& seen, UpdateReport& report);
  [[nodiscard]] Eigen::Matrix3d position_covariance() const;
  void decide_place(const TagObservations& seen, UpdateReport& report);
  [[nodiscard]] bool is_moved(int tag_id) const;
  bool relocalise(const TagObservations& seen);
  bool relocalise_by_views(const TagObservations& seen);

  // tag_admission.cpp
  [[nodiscard]] std::optional<TagVerdict> judge(const TagObservations& seen, const TagToUse& tag,
                                                const ViewLimits& limits);
  void initialise_new_tags(const TagObservations& seen, UpdateReport& report);
  bool admit(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
             UpdateReport& report);
  bool admit_while_lost(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT);
  void admit_known(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                   UpdateReport& report);
  void join(const TagObservations& seen, const TagObservation& tag, const Pose& X_VT);
  [[nodiscard]] bool is_where_first_seen(const TagObservations& seen, const TagToUse& tag,
                                         const TagVerdict& verdict);
  /// At its first sighting.
  bool admit_late(const TagToUse& tag, const TagVerdict& verdict, UpdateReport& report);
  void follow_again(long from, UpdateReport& report);

  BodySensors sensors_;
  EstimatorConfig config_;
  world::FilterState state_;  ///< At the instant of the last image.
  FilterMode mode_{FilterMode::kStarting};
  world::Propagator propagator_;
  world::ImageUpdate image_update_;
  world::ImageMemory memory_;
  std::optional<world::CloneWindow> window_;  ///< Only when points are tracked.
  world::HeldTags held_tags_;
  PoseFinder pose_finder_;
  JumpSearch jump_search_;
  WorkspaceAnchor anchor_;
  Contradictions contradictions_;
  TagCandidates candidates_;
  ImageTags tags_;
  std::vector<std::pair<TagToUse, TagVerdict>> decided_;  ///< Fresh ones with a certain branch.
  std::map<int, KnownTag> priors_;
  std::optional<Eigen::Vector3d> exact_tag_W_;  ///< Without IMU: position of a near map tag.
  ClockHypothesis clocks_;                      ///< Of the present start.
  ClockHypothesis restart_clocks_;
  GateLimits gate_;
  bool is_start_over_{false};
  MapKnowledge map_;                ///< For the present image.
  int relocalisation_attempts_{0};  ///< Images with a usable tag since the body was lost.
  PlaceDoubt place_doubt_;
  Instant contradicted_place_at_{};         ///< Last image with a proven tag that contradicts.
  std::optional<Instant> contradicted_at_;  ///< Last contradicting image: a clock may have jumped.
  bool may_have_jumped_{false};             ///< A clock, or a tag was moved: not decided yet.
  double gap_before_s_{0};                  ///< Without an accepted tag, before the present image.
  Eigen::Vector3d p_before_{Eigen::Vector3d::Zero()};  ///< Before the present correction …
  Eigen::Matrix3d P_before_{Eigen::Matrix3d::Zero()};  ///< … and its covariance.
  Eigen::Matrix3d P_at_fit_{Eigen::Matrix3d::Zero()};  ///< After the last accepted tag.
  int relocalisations_{0};                             ///< Since the filter was last consistent.
  int generation_{0};
};

}  // namespace fiducap
