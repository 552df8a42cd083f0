#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "estimation/start/start_search.hpp"
#include "estimation/update/tag_filter.hpp"

namespace fiducap::world {

/// The production filter: measurements of RCARS II-D4, state in workspace axes, errors on the
/// world's side. While the cameras' clocks are uncertain its start is processed again with other
/// hypotheses, the best of which replaces it (StartSearch).
class WorldFilter final : public BodyFilter {
 public:
  WorldFilter(BodySensors sensors, WorkspaceGauge gauge, EstimatorConfig config);
  WorldFilter(const WorldFilter&) = delete;  // search_ refers to it
  WorldFilter& operator=(const WorldFilter&) = delete;

  void propagate(const ImuSample& imu) override;
  UpdateReport update(const TagObservations& seen, const MapKnowledge& map) override;
  void set_tag_priors(std::vector<KnownTag> priors) override;
  void lose_motion() override;
  void note_clock_jump(int camera, double shift_s, double sigma_s) override {
    present_->note_clock_jump(camera, shift_s, sigma_s);
  }
  [[nodiscard]] bool running() const override { return present_->running(); }
  [[nodiscard]] BodyEstimate estimate() const override { return present_->estimate(); }
  /// None while the start may be replaced.
  void tag_beliefs(std::vector<TagBelief>& out) const override {
    search_.is_open() ? out.clear() : present_->tag_beliefs(out);
  }
  void own_tags(std::vector<TagBelief>& out) const override { present_->tag_beliefs(out); }
  void observe_starts(std::unique_ptr<FilterObserver> prototype) override {
    search_.observe(std::move(prototype));
  }
  [[nodiscard]] std::unique_ptr<FilterObserver> take_start() override { return std::move(start_); }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override {
    return present_->extrinsics();
  }
  [[nodiscard]] ClockEstimate clock(int camera) const override { return present_->clock(camera); }
  [[nodiscard]] LearnedSensors learned(int camera) const override {
    return present_->learned(camera);
  }

  /// None while the start may be replaced.
  void mismatches(std::vector<FoundMismatch>& out) const override {
    search_.is_open() ? out.clear() : present_->mismatches(out);
  }

  [[nodiscard]] const FilterState& state() const {
    return static_cast<const TagFilter&>(*present_).state();  // see make()
  }

 private:
  [[nodiscard]] HypothesisPlan::Prior clock_prior() const;
  [[nodiscard]] ClockHypothesis configured_clocks() const { return {clock_prior().shifts_s, 1.0}; }
  [[nodiscard]] bool are_clocks_vague() const;
  [[nodiscard]] std::vector<double> clocks_by_rotations(const StartLog& log) const;
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
  std::unique_ptr<FilterObserver> start_;  ///< Record of the selected start.
  int generation_;
};

}  // namespace fiducap::world
