#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "estimation/conversation/filter_conversation.hpp"
#include "estimation/start/start_search.hpp"
#include "estimation/world/world_coordinates.hpp"

namespace fiducap::world {

using WorldConversation = FilterConversation<WorldCoordinates>;

/// The production filter: the measurements of RCARS II-D4, the state in workspace axes, errors on
/// the world's side. While the cameras' clocks are vague and the filter young, its start is
/// followed again from other hypotheses beside it, and the best of them takes its place.
class WorldFilter final : public BodyFilter {
 public:
  WorldFilter(BodySensors sensors, WorkspaceGauge gauge, EstimatorConfig config);
  WorldFilter(const WorldFilter&) = delete;  // the search makes filters by it
  WorldFilter& operator=(const WorldFilter&) = delete;

  void propagate(const ImuSample& imu) override;
  UpdateReport update(const TagObservations& seen, const MapKnowledge& map) override;
  void set_tag_priors(std::vector<KnownTag> priors) override;
  void lose_motion() override;
  void note_clock_jump(int camera, Duration shift) override {
    present_->note_clock_jump(camera, shift);
  }
  void release_tag(int tag_id) override { present_->release_tag(tag_id); }
  [[nodiscard]] bool running() const override { return present_->running(); }
  [[nodiscard]] BodyEstimate estimate() const override { return present_->estimate(); }
  /// None while the start may be taken back: the map's knowledge may not.
  void tag_beliefs(std::vector<TagBelief>& out) const override;
  void own_tags(std::vector<TagBelief>& out) const override { present_->tag_beliefs(out); }
  void witness_starts(std::unique_ptr<FilterWitness> afresh) override {
    search_.witness(std::move(afresh));
  }
  [[nodiscard]] std::unique_ptr<FilterWitness> take_start() override { return std::move(start_); }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override {
    return present_->extrinsics();
  }
  [[nodiscard]] ClockEstimate clock(int camera) const override { return present_->clock(camera); }
  [[nodiscard]] LearnedSensors learned(int camera) const override {
    return present_->learned(camera);
  }

  /// None while the start may be taken back.
  void mismatches(std::vector<FoundMismatch>& out) const override;

  [[nodiscard]] const FilterState& state() const {
    return static_cast<const WorldConversation&>(*present_).state();  // make() makes no other
  }

 private:
  [[nodiscard]] HypothesisPlan::Prior clock_prior() const;
  [[nodiscard]] ClockHypothesis configured_clocks() const { return {clock_prior().shifts_s, 1.0}; }
  [[nodiscard]] bool are_clocks_vague() const;
  [[nodiscard]] std::unique_ptr<StartingFilter> make(const ClockHypothesis& clocks) const;
  void follow_restart();
  void take_over(StartSearch::Start better, const StartingFilter::Axes& before,
                 UpdateReport& report);

  BodySensors sensors_;
  WorkspaceGauge gauge_;
  EstimatorConfig config_;
  std::vector<KnownTag> priors_;
  StartSearch search_;
  std::unique_ptr<StartingFilter> present_;
  std::unique_ptr<FilterWitness> start_;  ///< Of the start that has won, until it is taken.
  int generation_;
};

}  // namespace fiducap::world

namespace fiducap {
extern template class FilterConversation<world::WorldCoordinates>;
}
