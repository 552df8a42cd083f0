#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "estimation/start/starting_filter.hpp"

namespace fiducap {

/// Sequence of hypotheses about the clocks, and selection of the best.
///
/// Images depend on the product of a camera's time shift and the motion. With both uncertain, a
/// fast rotation makes a linear filter confident of wrong velocities, biases and branches. The
/// start is therefore processed with several hypotheses: the configured shift, free; the shift
/// found so, until it converges; the configured one, held; others when all of these fit badly. The
/// best fit is selected. Order of use: next(), take() its outcome, until next() returns nullopt.
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

  /// @param present   clocks of the filter in use
  /// @param searches  allows a search when all hypotheses fit badly
  HypothesisPlan(Prior prior, std::span<const ClockEstimate> present, bool searches);

  /// The next hypothesis; nullopt: all are tried.
  [[nodiscard]] std::optional<ClockHypothesis> next() const;
  /// @return whether it is the best so far
  bool take(const Outcome& outcome);
  /// Even the best hypothesis fits badly.
  [[nodiscard]] bool is_poor() const;
  [[nodiscard]] bool has_searched() const { return has_searched_; }

 private:
  enum class Stage {
    kFree,      ///< The configured shift, refined.
    kPresent,   ///< The present filter's shift, refined.
    kHeld,      ///< The configured shift, held.
    kGrid,      ///< Shifts over the whole prior.
    kHalf,      ///< Half a step on both sides of the minimum, for a parabola's vertex.
    kVertex,    ///< At the vertex.
    kQuarter,   ///< A quarter step on both sides of the vertex.
    kSearched,  ///< The found shift, refined.
    kDone,
  };

  /// All cameras this far from the configured shifts: they usually share one computer.
  [[nodiscard]] ClockHypothesis beside(double sigmas, double spread) const;
  [[nodiscard]] bool is_far_off(std::span<const double> shifts_s,
                                std::span<const ClockEstimate> found) const;
  bool take_refined(const Outcome& outcome, double cost);
  void take_searched(double cost);
  void enter(Stage stage);
  void refine_from(ClockHypothesis hypothesis);

  Prior prior_;
  std::vector<double> present_shifts_s_;
  bool has_present_moved_;
  bool may_search_;
  bool has_searched_{false};

  Stage stage_{Stage::kFree};
  ClockHypothesis trying_;
  int refinements_{0};
  bool was_best_{false};  ///< Last step of the present refinement.
  Explanation best_{std::numeric_limits<double>::infinity(), 0};
  double lowest_{0};  ///< In sigmas of the prior.
  double lowest_cost_{std::numeric_limits<double>::infinity()};
  int step_{0};  ///< In the present stage.
  std::array<double, 2> beside_cost_{};
};

}  // namespace fiducap
