#include "estimation/start/hypothesis_plan.hpp"

#include <utility>

#include "base/numeric.hpp"

namespace fiducap {

namespace {
// Limits of repeated refinement of a shift from its last result.
constexpr int kMostRefinements = 3;
constexpr double kFarOff_s = 0.003;
constexpr double kSure_sigma = 3.0;
// Largest deviation from the prior.
constexpr double kMost_sigma = 6.0;
// Smallest cost difference that distinguishes two hypotheses.
constexpr double kClearlyBetter = 10.0;
// Cost per number of a bad fit: 1 is expected, occluded corners give 1.2; few numbers scatter.
constexpr double kPoorCost = 1.25;
constexpr double kPoorScatter = 4.0;
// Range of the search, in sigmas of the prior.
constexpr int kSearched_sigma = 4;
constexpr double kFoundSpread = 0.5;
// Numbers above which a search would take too long.
constexpr double kMostSearchedNumbers = 8 * 1200.0;
}  // namespace

HypothesisPlan::HypothesisPlan(Prior prior, std::span<const ClockEstimate> present, bool searches)
    : prior_(std::move(prior)), may_search_(searches) {
  for (const ClockEstimate& clock : present) present_shifts_s_.push_back(clock.shift_s);
  has_present_moved_ = is_far_off(prior_.shifts_s, present);
  refine_from(beside(0, 1.0));
}

ClockHypothesis HypothesisPlan::beside(double sigmas, double spread) const {
  ClockHypothesis hypothesis{prior_.shifts_s, spread};
  for (std::size_t k = 0; k < hypothesis.shifts_s.size(); ++k)
    hypothesis.shifts_s[k] += sigmas * prior_.sigmas_s[k];
  return hypothesis;
}

std::optional<ClockHypothesis> HypothesisPlan::next() const {
  if (stage_ == Stage::kDone) return std::nullopt;
  return trying_;
}

bool HypothesisPlan::take(const Outcome& outcome) {
  double cost_of_shifts = 0;
  for (std::size_t k = 0; k < outcome.clocks.size(); ++k) {
    if (!(prior_.sigmas_s[k] > 0)) continue;  // known exactly
    const double sigmas = (outcome.clocks[k].shift_s - prior_.shifts_s[k]) / prior_.sigmas_s[k];
    cost_of_shifts += sigmas * sigmas;
  }
  const double cost = outcome.explanation.cost + cost_of_shifts;
  switch (stage_) {
    case Stage::kFree:
    case Stage::kPresent:
    case Stage::kSearched:
      return take_refined(outcome, cost);
    case Stage::kHeld: {
      const bool is_best = cost < best_.cost + kClearlyBetter;
      if (is_best) best_ = {cost, outcome.explanation.numbers};
      has_searched_ = is_poor() && may_search_ && best_.numbers < kMostSearchedNumbers;
      enter(has_searched_ ? Stage::kGrid : Stage::kDone);
      return is_best;
    }
    default:
      take_searched(cost);
      return false;
  }
}

bool HypothesisPlan::take_refined(const Outcome& outcome, double cost) {
  // Another shift must be clearly better; the same one refined must be as good.
  const bool is_best = cost < best_.cost + (was_best_ ? kClearlyBetter : -kClearlyBetter);
  if (is_best) best_ = {cost, outcome.explanation.numbers};
  was_best_ = is_best;
  const bool again =
      refinements_ < kMostRefinements && is_far_off(trying_.shifts_s, outcome.clocks);
  if (again) {
    ++refinements_;
    for (std::size_t k = 0; k < trying_.shifts_s.size(); ++k)
      trying_.shifts_s[k] = outcome.clocks[k].shift_s;
  } else if (stage_ == Stage::kFree) {
    enter(has_present_moved_ ? Stage::kPresent : Stage::kHeld);
  } else {
    enter(stage_ == Stage::kPresent ? Stage::kHeld : Stage::kDone);
  }
  return is_best;
}

void HypothesisPlan::take_searched(double cost) {
  if (stage_ == Stage::kGrid) {
    const int sigmas = step_ - kSearched_sigma;
    if (cost < lowest_cost_) lowest_ = sigmas;
    lowest_cost_ = std::min(cost, lowest_cost_);
    if (++step_ <= 2 * kSearched_sigma) {
      trying_ = beside(step_ - kSearched_sigma, 0.0);
    } else {
      enter(Stage::kHalf);
    }
  } else if (stage_ == Stage::kVertex) {
    lowest_cost_ = cost;
    enter(Stage::kQuarter);
  } else {
    const double step = stage_ == Stage::kHalf ? 0.5 : 0.25;
    beside_cost_[static_cast<std::size_t>(step_)] = cost;
    if (step_++ == 0) {
      trying_ = beside(lowest_ + step, 0.0);
      return;
    }
    const auto [below, above] = beside_cost_;
    lowest_ += minimum_of_parabola(below, lowest_cost_, above) * step;
    enter(stage_ == Stage::kHalf ? Stage::kVertex : Stage::kSearched);
  }
}

void HypothesisPlan::enter(Stage stage) {
  stage_ = stage;
  step_ = 0;
  if (stage == Stage::kPresent) return refine_from({present_shifts_s_, kFoundSpread});
  if (stage == Stage::kSearched) return refine_from(beside(lowest_, kFoundSpread));
  if (stage == Stage::kHeld) trying_ = beside(0, 0.0);
  if (stage == Stage::kGrid) trying_ = beside(-kSearched_sigma, 0.0);
  if (stage == Stage::kHalf) trying_ = beside(lowest_ - 0.5, 0.0);
  if (stage == Stage::kVertex) trying_ = beside(lowest_, 0.0);
  if (stage == Stage::kQuarter) trying_ = beside(lowest_ - 0.25, 0.0);
}

void HypothesisPlan::refine_from(ClockHypothesis hypothesis) {
  trying_ = std::move(hypothesis);
  refinements_ = 0;
  was_best_ = false;
}

bool HypothesisPlan::is_poor() const {
  return best_.cost > kPoorCost * best_.numbers + kPoorScatter * std::sqrt(best_.numbers);
}

bool HypothesisPlan::is_far_off(std::span<const double> shifts_s,
                                std::span<const ClockEstimate> found) const {
  for (std::size_t k = 0; k < found.size(); ++k) {
    const double moved_s = std::abs(found[k].shift_s - shifts_s[k]);
    const bool is_possible =
        std::abs(found[k].shift_s - prior_.shifts_s[k]) < kMost_sigma * prior_.sigmas_s[k];
    if (is_possible && moved_s > std::max(kFarOff_s, kSure_sigma * found[k].shift_sigma_s))
      return true;
  }
  return false;
}

}  // namespace fiducap
