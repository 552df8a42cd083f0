#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "capture/imu_sample.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/start/starting_filter.hpp"

namespace fiducap {

/// Sequence of hypotheses about the clocks, and selection of the best.
///
/// Images depend on the product of a camera's time shift and the motion. With both uncertain, a
/// fast rotation makes a linear filter confident of wrong velocities, biases and branches. The
/// start is therefore processed with several hypotheses: the configured shift, free; that of the
/// filter in use; the configured one, held; and when all of these fit badly, that by the rotations
/// of camera and gyroscope. All but the held one are repeated at the shift found so, until it
/// stays. The best fit is selected. Order of use: next(), take() its outcome, until next() returns
/// nullopt.
class HypothesisPlan final {
 public:
  /// Prior of the clocks, one per camera.
  struct Prior {
    std::vector<double> shifts_s;  ///< As configured or stored.
    std::vector<double> sigmas_s;  ///< 0: exact.
  };
  /// Result of a hypothesis.
  struct Outcome {
    Explanation explanation;
    std::vector<ClockEstimate> clocks;  ///< At the end, one per camera.
  };

  /// @param present  clocks of the filter in use
  HypothesisPlan(Prior prior, std::span<const ClockEstimate> present);

  /// The next hypothesis; nullopt: all are tried.
  [[nodiscard]] std::optional<ClockHypothesis> next() const;
  /// @return whether it is the best so far
  bool take(const Outcome& outcome);
  /// All so far fit badly, and the offsets by rotations are to be added.
  [[nodiscard]] bool needs_rotations() const;
  void add_rotations(std::vector<double> shifts_s);

 private:
  [[nodiscard]] bool is_far_off(std::span<const double> shifts_s,
                                std::span<const ClockEstimate> found) const;

  Prior prior_;
  bool has_rotations_{false};
  std::vector<ClockHypothesis> planned_;
  std::size_t at_{0};  ///< Of `planned_`.
  int refinements_{0};
  bool was_best_{false};  ///< Last step of the present refinement.
  Explanation best_{std::numeric_limits<double>::infinity(), 0};
};

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
  /// Clock offsets by rotations, one per camera.
  using MeasureClocks = std::function<std::vector<double>(const StartLog&)>;
  /// A filter that has processed the start, with its record.
  struct Start {
    std::unique_ptr<StartingFilter> filter;
    std::unique_ptr<FilterObserver> observer;  ///< nullptr: not recorded.
  };

  /// @param make  a filter that starts with this hypothesis
  StartSearch(HypothesisPlan::Prior prior, bool is_needed, MakeFilter make, MeasureClocks measure);

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
  MeasureClocks measure_;
  std::unique_ptr<FilterObserver> observer_;
  bool is_open_{true};
  StartLog log_;
  std::size_t due_looks_{0};           ///< Searches due to time, since the log began.
  std::size_t contradicted_looks_{0};  ///< Searches due to contradicting images.
  std::size_t next_contradicted_{0};   ///< Images before the next of these.

  std::optional<HypothesisPlan> plan_;   ///< Of the present search.
  std::size_t horizon_{0};               ///< Images on which each hypothesis is tried.
  InitialisationPriors priors_;          ///< Of the filter in use when the plan began …
  std::vector<double> priors_shifts_s_;  ///< … with these clock shifts.
  std::optional<Trial> trial_;
  std::optional<Trial> best_;
};

}  // namespace fiducap
