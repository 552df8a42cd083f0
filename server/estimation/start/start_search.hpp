#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "estimation/start/clock_hypothesis.hpp"
#include "estimation/start/hypothesis_plan.hpp"
#include "estimation/start/start_log.hpp"

namespace fiducap {

/// Finds the hypothesis about the clocks that explains a start best, beside the filter that is in
/// use.
///
/// It keeps what came in since the first tag. After 2, 4 and 6 seconds (after 12, too, when the IMU
/// seems noisier than it was said to be), and when images contradict each other, it follows the
/// start again with trial filters, one hypothesis after the other (HypothesisPlan), so much of it
/// with each image and no more: the filter in use goes on giving poses meanwhile. The best trial
/// then catches up with the present and takes over. At most two trials are kept. Work is counted by
/// sightings, not by a clock, so that a replay does the same.
class StartSearch final {
 public:
  using MakeFilter = std::function<std::unique_ptr<StartingFilter>(const ClockHypothesis&)>;
  /// A filter that has followed the start, and what it saw.
  struct Start {
    std::unique_ptr<StartingFilter> filter;
    std::unique_ptr<FilterWitness> witness;  ///< nullptr: nobody wants to know.
  };

  /// @param make  a filter that starts with this hypothesis
  StartSearch(HypothesisPlan::Prior prior, bool is_needed, MakeFilter make);

  /// Each start is noted down by one like this.
  void witness(std::unique_ptr<FilterWitness> afresh) { witness_ = std::move(afresh); }
  /// Everything starts from nothing: also the log.
  void begin();
  /// The start may still be taken back.
  [[nodiscard]] bool is_open() const { return is_open_; }

  void add(const ImuSample& imu);
  /// Takes in an image that the filter in use has just taken in, and works on.
  /// @return the filter to use from now on, which stands at the same image; nullopt: the same
  [[nodiscard]] std::optional<Start> add(const TagObservations& seen, const MapKnowledge& map,
                                         StartingFilter& present);

 private:
  /// A filter on its way through the log.
  struct Trial {
    ClockHypothesis hypothesis;
    Start start;
    std::vector<std::size_t> order;  ///< Of the images, by the hypothesis.
    std::size_t images{0};           ///< So many of `order` are behind it …
    std::size_t readings{0};         ///< … and so many readings.
    Explanation explanation;
  };

  [[nodiscard]] bool is_due(Instant now, const StartingFilter& present);
  void begin_plan(const StartingFilter& present);
  [[nodiscard]] bool is_noise_settled(const StartingFilter& present) const;
  [[nodiscard]] bool is_of_learned_clocks(const ClockHypothesis& hypothesis) const;
  [[nodiscard]] Trial begin_trial(const ClockHypothesis& hypothesis) const;
  void advance(Trial& trial, double& work) const;
  void take_reading(Trial& trial) const;
  void take_image(Trial& trial, const StartLog::Image& image) const;
  void judge_trial();
  /// @return whether the best trial stands where the present filter does
  bool catch_up(double& work);
  void close(StartingFilter& filter);

  HypothesisPlan::Prior prior_;
  bool is_needed_;
  MakeFilter make_;
  std::unique_ptr<FilterWitness> witness_;
  bool is_open_{true};
  StartLog log_;
  std::size_t due_looks_{0};           ///< Since the log began …
  std::size_t contradicted_looks_{0};  ///< … and those because images contradicted each other.
  std::size_t next_contradicted_{0};   ///< Not before so many images.
  int failed_clock_searches_{0};  ///< For another clock, since a start was last explained well.

  std::optional<HypothesisPlan> plan_;    ///< While a look lasts.
  std::size_t horizon_{0};                ///< Images that every hypothesis of the look is tried on.
  StartLessons lessons_;                  ///< Of the filter in use, when the present plan began …
  std::vector<double> lessons_clocks_s_;  ///< … with these shifts.
  std::optional<Trial> trial_;
  std::optional<Trial> best_;
};

}  // namespace fiducap
