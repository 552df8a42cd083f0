#pragma once

#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "estimation/conversation/body_follower.hpp"
#include "estimation/conversation/contradictions.hpp"
#include "estimation/conversation/image_tags.hpp"
#include "estimation/conversation/lone_return.hpp"
#include "estimation/conversation/restless_tags.hpp"
#include "estimation/conversation/workspace_anchor.hpp"
#include "estimation/start/clock_hypothesis.hpp"

namespace fiducap {

/// What an image, the map and a filter say to each other, in whatever coordinates the filter has:
/// which tags correct the state, which may join it, what defines the workspace, when the body is
/// lost and how it is found again, when everything is given up, and what is reported.
///
/// @tparam Coordinates  the state and what can be done to it: world::WorldCoordinates or
///                      robocentric::RobocentricCoordinates
template <class Coordinates>
class FilterConversation final : public StartingFilter {
 public:
  /// @param clocks  how it starts
  FilterConversation(BodySensors sensors, const WorkspaceGauge& gauge,
                     const EstimatorConfig& config, ClockHypothesis clocks);

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
  [[nodiscard]] ClockEstimate clock(int camera) const override;
  void mismatches(std::vector<FoundMismatch>& out) const override;
  [[nodiscard]] LearnedSensors learned(int camera) const override;

  [[nodiscard]] Explanation explain(const TagObservations& seen,
                                    const UpdateReport& report) const override;
  [[nodiscard]] bool is_following() const override { return follower_.is_running(); }
  [[nodiscard]] int contradicting_images() const override {
    return contradictions_.contradicting_images();
  }
  [[nodiscard]] StartLessons lessons() const override { return coordinates().lessons(); }
  void begin_with(const StartLessons& lessons) override { coordinates().begin_with(lessons); }
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
  /// What the map says first, and whether the body is still followed.
  void meet(const TagObservations& seen, std::span<const KnownTag> known, UpdateReport& report);
  void follow_map(UpdateReport& report);
  void sort(const TagObservations& seen, std::span<const KnownTag> known);
  /// @return iterations of the update; 0: the state does not stand at this image
  int move_to(const TagObservations& seen);
  UpdateReport correct(const TagObservations& seen, int iterations);
  void correct(const TagObservations& seen, int iterations, UpdateReport& report);
  void pardon_all();
  void look_for_jump(const TagObservations& seen, UpdateReport& report);
  void answer_contradictions(const TagObservations& seen, UpdateReport& report);
  void relocalise(const TagObservations& seen, UpdateReport& report);
  [[nodiscard]] bool is_one_tag_against_all() const;
  [[nodiscard]] bool is_place_kept(Instant now) const;
  [[nodiscard]] bool is_proven(const TagToUse& tag) const;
  [[nodiscard]] bool may_give_up_usable() const;
  void give_up(int tag_id, Instant at, UpdateReport& report);
  void note_witnesses();
  void note_elsewhere(const TagObservations& seen);
  void watch_return(const TagObservations& seen, UpdateReport& report);
  void answer_return(const TagObservations& seen, LoneReturn::Verdict verdict,
                     std::span<const int> against, UpdateReport& report);
  void shift_axes(const std::optional<Pose>& X_new_old, UpdateReport& report);
  void note_exact_tags();
  void add_bend_of_prints(BodyEstimate& body) const;

  void lose_motion(bool is_turn_lost);
  bool come_back(const TagObservations& seen);
  [[nodiscard]] bool is_return_doubtful(const Pose& X_AB, Instant at) const;
  /// One tag whose views since, compared with the gyro, decide its branch.
  bool come_back_by_views(const TagObservations& seen);
  void jump(const Pose& X_AB, Instant at);

  [[nodiscard]] std::optional<TagVerdict> judge(const TagObservations& seen, const TagToUse& tag,
                                                const Patience& patience);
  void meet_fresh_tags(const TagObservations& seen, UpdateReport& report);
  bool admit(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
             UpdateReport& report);
  bool admit_adrift(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT);
  void admit_known(const TagObservations& seen, const TagToUse& tag, const Pose& X_VT,
                   UpdateReport& report);
  void join(const TagObservations& seen, const TagObservation& tag, const Pose& X_VT);
  [[nodiscard]] bool is_where_first_seen(const TagObservations& seen, const TagToUse& tag,
                                         const TagVerdict& verdict);
  /// Where it was first seen, when past images are remembered.
  bool admit_late(const TagToUse& tag, const TagVerdict& verdict, UpdateReport& report);
  void wait(const TagObservations& seen, const TagToUse& tag);
  void follow_again(long from, UpdateReport& report);

  BodyFollower<Coordinates> follower_;
  WorkspaceAnchor<Coordinates> anchor_;
  Contradictions contradictions_;
  TagCandidates candidates_;
  ImageTags tags_;
  std::vector<std::pair<TagToUse, TagVerdict>> decided_;  ///< Fresh ones whose branch is certain.
  std::map<int, KnownTag> priors_;
  std::optional<Eigen::Vector3d> exact_tag_W_;  ///< Without IMU: place of one in the map, near.
  ClockHypothesis clocks_;                      ///< As it has started …
  ClockHypothesis restart_clocks_;
  double gate_;
  bool is_start_over_{false};
  MapKnowledge map_;        ///< For the present image.
  int return_attempts_{0};  ///< Images since adrift that showed a usable tag.
  RestlessTags restless_;
  std::vector<GivenUpTag> unwitnessed_;  ///< By what the body alone knew.
  /// Where proven tags that contradict want the body, from where it is thought to be, W axes; until
  /// another proven one decides.
  std::optional<Eigen::Vector3d> elsewhere_W_;
  int elsewhere_tag_{-1};  ///< One of them.
  LoneReturn return_;
  std::optional<Instant> suspected_at_;  ///< Images contradicted last: a clock may have jumped.
  bool may_have_jumped_{false};          ///< That, or a tag was moved.
  double gap_before_s_{0};               ///< Without a fit, before the present image.
  BodyPlace place_before_;               ///< Before it was corrected.
  int relocalisations_{0};               ///< Since the filter was last trusted …
  int images_trusted_{0};                ///< … for so many images now.
  int generation_{0};
};

}  // namespace fiducap
