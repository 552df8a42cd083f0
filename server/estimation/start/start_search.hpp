#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "capture/imu_sample.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/start/hypothesis_plan.hpp"
#include "estimation/start/starting_filter.hpp"

namespace fiducap {

/// All inputs of a filter since one second before its first tag, for trial filters with other
/// clocks. Bounded in time, samples, images and sightings.
class StartLog final {
 public:
  struct Image {
    TagObservations seen;
    std::vector<KnownTag> known;
    bool may_define_workspace{};
  };

  void add(const ImuSample& imu);
  /// Images before the first tag are not kept.
  void add(const TagObservations& seen, const MapKnowledge& map);
  /// The bounds are reached; nothing more is added.
  [[nodiscard]] bool is_full() const;
  /// 0 before the first tag.
  [[nodiscard]] double seconds_since_first_tag(Instant now) const;
  [[nodiscard]] const std::vector<ImuSample>& imu() const { return imu_; }
  [[nodiscard]] const std::vector<Image>& images() const { return images_; }

 private:
  std::vector<ImuSample> imu_;
  std::vector<Image> images_;
  std::size_t sightings_{0};
};

/// Finds the hypothesis about the clocks that fits a start best, beside the filter in use.
///
/// Logs the inputs since the first tag. After 2, 4 and 6 seconds (also 12 when the IMU seems
/// noisier than configured) and when images contradict each other, it processes the start again
/// with trial filters, one per hypothesis (HypothesisPlan), a bounded amount of work per image,
/// while the filter in use continues. The best trial then catches up with the present and replaces
/// it. At most two trials are kept. Work is counted in sightings, not in time, for deterministic
/// replay.
class StartSearch final {
 public:
  using MakeFilter = std::function<std::unique_ptr<StartingFilter>(const ClockHypothesis&)>;
  /// A filter that has processed the start, with its record.
  struct Start {
    std::unique_ptr<StartingFilter> filter;
    std::unique_ptr<FilterObserver> observer;  ///< nullptr: not recorded.
  };

  /// @param make  a filter that starts with this hypothesis
  StartSearch(HypothesisPlan::Prior prior, bool is_needed, MakeFilter make);

  /// Each trial is recorded by a copy of `prototype`.
  void observe(std::unique_ptr<FilterObserver> prototype) { observer_ = std::move(prototype); }
  /// Restarts with an empty log.
  void begin();
  /// The start may still be replaced.
  [[nodiscard]] bool is_open() const { return is_open_; }

  void add(const ImuSample& imu);
  /// Adds an image that the filter in use has just processed, and continues the search.
  /// @return the filter to use from now on, at the same image; nullopt: the same as before
  [[nodiscard]] std::optional<Start> add(const TagObservations& seen, const MapKnowledge& map,
                                         StartingFilter& present);

 private:
  /// A filter that is processing the log.
  struct Trial {
    ClockHypothesis hypothesis;
    Start start;
    std::vector<std::size_t> order;  ///< Images in the order of their times by the hypothesis.
    std::size_t images{0};           ///< Processed ones of `order`.
    std::size_t readings{0};         ///< Processed IMU samples.
    Explanation explanation;
  };

  [[nodiscard]] bool is_due(Instant now, const StartingFilter& present);
  void begin_plan(const StartingFilter& present);
  [[nodiscard]] bool is_noise_settled(const StartingFilter& present) const;
  [[nodiscard]] Trial begin_trial(const ClockHypothesis& hypothesis) const;
  void advance(Trial& trial, double& work) const;
  void take_reading(Trial& trial) const;
  void take_image(Trial& trial, const StartLog::Image& image) const;
  void judge_trial();
  /// @return whether the best trial has reached the present filter
  bool catch_up(double& work);
  void close(StartingFilter& filter);

  HypothesisPlan::Prior prior_;
  bool is_needed_;
  MakeFilter make_;
  std::unique_ptr<FilterObserver> observer_;
  bool is_open_{true};
  StartLog log_;
  std::size_t due_looks_{0};           ///< Searches due to time, since the log began.
  std::size_t contradicted_looks_{0};  ///< Searches due to contradicting images.
  std::size_t next_contradicted_{0};   ///< Images before the next of these.
  int failed_clock_searches_{0};       ///< Since a start was last fitted well.

  std::optional<HypothesisPlan> plan_;   ///< Of the present search.
  std::size_t horizon_{0};               ///< Images on which each hypothesis is tried.
  InitialisationPriors priors_;          ///< Of the filter in use when the plan began …
  std::vector<double> priors_shifts_s_;  ///< … with these clock shifts.
  std::optional<Trial> trial_;
  std::optional<Trial> best_;
};

}  // namespace fiducap
