#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "estimation/start/clock_hypothesis.hpp"

namespace fiducap {

/// Which hypotheses about the clocks are tried, in which order, and which of them wins.
///
/// A camera's time shift and the motion enter the images as a product. While both are vague, in a
/// quick turn, a linear filter becomes sure of wrong velocities and biases, and takes wrong
/// branches. So the start is followed from several hypotheses: the configured shift, free; the
/// shift that was found so, until it moves no more; the configured one, held; and others when all
/// of these explain the images badly. The one that explains them best goes on (an iterated filter
/// over the start, from many beginnings). Order of use: next(), take() what became of it, until
/// next() has none.
class HypothesisPlan final {
 public:
  /// What is known about the clocks beforehand, one per camera.
  struct Prior {
    std::vector<double> shifts_s;  ///< As configured or stored …
    std::vector<double> sigmas_s;  ///< … and how far it may be off; 0: exact.
  };
  /// What became of a hypothesis.
  struct Outcome {
    Explanation explanation;
    std::vector<ClockEstimate> clocks;  ///< At the end, one per camera.
  };

  /// @param present   the clocks of the filter that is in use
  /// @param searches  whether others may be searched when all explain badly
  HypothesisPlan(Prior prior, std::span<const ClockEstimate> present, bool searches);

  /// What to try now; nullopt: all is tried.
  [[nodiscard]] std::optional<ClockHypothesis> next() const;
  /// @return whether it is the best so far
  bool take(const Outcome& outcome);
  /// Even the best explains its images badly.
  [[nodiscard]] bool is_poor() const;
  [[nodiscard]] bool has_searched() const { return has_searched_; }

 private:
  enum class Stage {
    kFree,      ///< The configured shift, refined.
    kPresent,   ///< The shift that the present filter has found, refined.
    kHeld,      ///< The configured shift, held.
    kGrid,      ///< Shifts over the whole prior …
    kHalf,      ///< … half a step beside the lowest, twice, for a parabola's vertex …
    kVertex,    ///< … at it …
    kQuarter,   ///< … and a quarter beside that.
    kSearched,  ///< What that found, refined.
    kDone,
  };

  [[nodiscard]] ClockHypothesis configured(double spread) const;
  /// All cameras by the same number of sigmas: they hang on one computer more often than not.
  [[nodiscard]] ClockHypothesis beside(double sigmas, double spread) const;
  [[nodiscard]] bool is_far_off(std::span<const double> shifts_s,
                                std::span<const ClockEstimate> found) const;
  [[nodiscard]] double cost_of_shifts(std::span<const ClockEstimate> clocks) const;
  bool take_refined(const Outcome& outcome, double cost);
  void take_searched(double cost);
  void enter(Stage stage);
  void refine_from(ClockHypothesis hypothesis);
  [[nodiscard]] double vertex(double step) const;

  Prior prior_;
  std::vector<double> present_shifts_s_;
  bool has_present_moved_;
  bool may_search_;
  bool has_searched_{false};

  Stage stage_{Stage::kFree};
  ClockHypothesis trying_;
  int refinements_{0};
  bool was_best_{false};  ///< The last of the present refinement.
  Explanation best_{std::numeric_limits<double>::infinity(), 0};
  double lowest_{0};  ///< In sigmas of the prior.
  double lowest_cost_{std::numeric_limits<double>::infinity()};
  int step_{0};  ///< Of the present stage of a search.
  std::array<double, 2> beside_cost_{};
};

}  // namespace fiducap
