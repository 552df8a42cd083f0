#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "estimation/filter/tag_measurement.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/start/tag_candidates.hpp"
#include "estimation/update/body_follower.hpp"
#include "estimation/update/contradictions.hpp"
#include "estimation/update/workspace_anchor.hpp"

namespace fiducap {

/// The tags of one image. Reused between images to avoid allocations.
struct ImageTags {
  std::vector<TagToUse> usable;  ///< Correct the state.
  std::vector<TagToUse> fresh;   ///< May join the state.
  std::vector<bool> accepted;    ///< Per usable one, by the last update.

  /// @param is_anchored  the map's poses are in this filter's axes
  template <class State>
  void sort(const TagObservations& seen, std::span<const KnownTag> known, const State& state,
            bool is_anchored) {
    usable.clear();
    fresh.clear();
    for (const TagObservation& tag : seen.tags) {
      const auto found = std::ranges::find(known, tag.tag_id, &KnownTag::tag_id);
      const TagToUse use{&tag, state.find(tag.tag_id), found == known.end() ? nullptr : &*found};
      const bool is_usable = use.local >= 0 || (use.known != nullptr && is_anchored);
      (is_usable ? usable : fresh).push_back(use);
    }
  }

  /// Updates the indices after tags were removed from the state.
  template <class State>
  void find_again(const State& state) {
    for (std::size_t i = usable.size(); i-- > 0;) {
      usable[i].local = state.find(usable[i].seen->tag_id);
      if (usable[i].local >= 0 || usable[i].known != nullptr) continue;
      usable.erase(usable.begin() + static_cast<std::ptrdiff_t>(i));
      accepted.erase(accepted.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
};

/// The update cycle of the EKF: gating, initialisation of tags, definition of the workspace,
/// removal of outliers, relocalisation, restart and report. Independent of the state's coordinates.
///
/// @tparam Coordinates  state and its operations: world::WorldCoordinates
template <class Coordinates>
class TagFilter final : public StartingFilter {
 public:
  /// @param clocks  of the first start
  TagFilter(BodySensors sensors, const WorkspaceGauge& gauge, const EstimatorConfig& config,
            ClockHypothesis clocks);

  void propagate(const ImuSample& imu) override;
  UpdateReport update(const TagObservations& seen, const MapKnowledge& map) override;
  void set_tag_priors(std::vector<KnownTag> priors) override;
  void lose_motion() override { lose_motion(false); }
  void note_clock_jump(int camera, Duration shift) override;
  void release_tag(int tag_id) override;
  [[nodiscard]] bool running() const override;
  [[nodiscard]] BodyEstimate estimate() const override;
  void tag_beliefs(std::vector<TagBelief>& out) const override;
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override;
  [[nodiscard]] ClockEstimate clock(int camera) const override {
    return coordinates().clock(camera);
  }
  void mismatches(std::vector<FoundMismatch>& out) const override;
  [[nodiscard]] LearnedSensors learned(int camera) const override {
    return coordinates().learned(camera);
  }

  [[nodiscard]] Explanation explain(const TagObservations& seen,
                                    const UpdateReport& report) const override;
  [[nodiscard]] bool is_following() const override { return follower_.is_running(); }
  [[nodiscard]] int contradicting_images() const override {
    return contradictions_.contradicting_images();
  }
  [[nodiscard]] InitialisationPriors initialisation_priors() const override {
    return coordinates().initialisation_priors();
  }
  void begin_with(const InitialisationPriors& priors) override { coordinates().begin_with(priors); }
  void end_start() override;
  [[nodiscard]] Axes axes() const override { return {anchor_.is_anchored(), anchor_.defined_by()}; }
  [[nodiscard]] int generation() const override { return generation_; }
  void set_generation(int generation) override { generation_ = generation; }
  void set_restart_clocks(ClockHypothesis clocks) override { restart_clocks_ = std::move(clocks); }

  [[nodiscard]] const auto& state() const { return coordinates().state(); }

 private:
  [[nodiscard]] Coordinates& coordinates() { return follower_.coordinates(); }
  [[nodiscard]] const Coordinates& coordinates() const { return follower_.coordinates(); }
  [[nodiscard]] bool has_imu() const { return follower_.has_imu(); }
  [[nodiscard]] bool is_in_mode(FilterMode mode) const { return follower_.mode() == mode; }

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
  void shift_axes(const std::optional<Pose>& X_new_old, UpdateReport& report);
  void note_exact_tags();
  void add_bend_of_prints(BodyEstimate& body) const;

  // relocalisation_impl.hpp
  void reset_outlier_counters();
  void look_for_jump(const TagObservations& seen, UpdateReport& report);
  void handle_outliers(const TagObservations& seen, UpdateReport& report);
  void begin_relocalisation(const TagObservations& seen, UpdateReport& report);
  [[nodiscard]] bool only_one_outlier_tag() const;
  [[nodiscard]] bool is_proven(const TagToUse& tag) const;
  void discard_tag(int tag_id, Instant at, UpdateReport& report);
  void confirm_removals();
  void update_ambiguity(const TagObservations& seen);
  void check_single_tag_relocalisation(const TagObservations& seen, UpdateReport& report);
  void lose_motion(bool is_turn_lost);
  bool relocalise(const TagObservations& seen);
  [[nodiscard]] bool is_relocalisation_doubtful(const Pose& X_AB, Instant at) const;
  /// By a tag whose branch is decided by its views since, with the gyroscope.
  bool relocalise_by_views(const TagObservations& seen);
  void jump(const Pose& X_AB, Instant at);

  // admission_impl.hpp
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
  /// At its first sighting, when past images are remembered.
  bool admit_late(const TagToUse& tag, const TagVerdict& verdict, UpdateReport& report);
  void follow_again(long from, UpdateReport& report);

  BodyFollower<Coordinates> follower_;
  WorkspaceAnchor<Coordinates> anchor_;
  Contradictions contradictions_;
  TagCandidates candidates_;
  ImageTags tags_;
  std::vector<std::pair<TagToUse, TagVerdict>> decided_;  ///< Fresh ones with a certain branch.
  std::map<int, KnownTag> priors_;
  std::optional<Eigen::Vector3d> exact_tag_W_;  ///< Without IMU: position of a near map tag.
  ClockHypothesis clocks_;                      ///< Of the present start.
  ClockHypothesis restart_clocks_;
  double gate_;
  bool is_start_over_{false};
  MapKnowledge map_;                ///< For the present image.
  int relocalisation_attempts_{0};  ///< Images with a usable tag since the body was lost.
  UnstableTags unstable_tags_;
  std::vector<RemovedTag> unconfirmed_removals_;  ///< Not confirmed by another proven tag yet.
  /// Position of the body by contradicting proven tags, relative to the estimate, W axes; until
  /// another proven tag decides.
  std::optional<Eigen::Vector3d> ambiguous_offset_W_;
  int ambiguous_tag_{-1};  ///< One of them.
  SingleTagRelocalisation single_tag_;
  std::optional<Instant> contradicted_at_;  ///< Last contradicting image: a clock may have jumped.
  bool may_have_jumped_{false};             ///< A clock, or a tag was moved.
  double gap_before_s_{0};                  ///< Without an accepted tag, before the present image.
  BodyPlace place_before_;                  ///< Before the present correction.
  int relocalisations_{0};                  ///< Since the filter was last consistent.
  int images_trusted_{0};                   ///< Consistent images.
  int generation_{0};
};

}  // namespace fiducap
