#include "calibration/intrinsics/lens_terms.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/lens_covariance.hpp"
#include "calibration/intrinsics/lens_shape.hpp"

namespace fiducap {
namespace {

// k3 is estimated where it is this many sigma from zero; it bends the image outside of what was
// seen.
constexpr double kThirdRadial_sigma = 5;
// Squared residuals, in units of their variance, that one term must explain: two sigma.
constexpr double kPerTerm = 4;

// Images that know the focal length as well as this determine the distortion, too.
constexpr double kDeterminedFocal = 0.01;

using Numbers = std::vector<int>;

bool has(const Numbers& free, int number) {
  return std::find(free.begin(), free.end(), number) != free.end();
}

Numbers without(const Numbers& free, std::initializer_list<int> gone) {
  Numbers out;
  for (const int number : free)
    if (std::find(gone.begin(), gone.end(), number) == gone.end()) out.push_back(number);
  return out;
}

/// One term fewer: the highest order, or both tangential ones.
std::vector<Numbers> simpler_than(const Numbers& free, Distortion kind) {
  std::vector<Numbers> out;
  const bool radial_tangential = kind == Distortion::kRadialTangential;
  const Numbers orders = radial_tangential ? Numbers{8, 5, 4} : Numbers{7, 6, 5, 4};
  for (const int order : orders) {
    if (!has(free, order)) continue;
    out.push_back(without(free, {order}));
    break;
  }
  if (radial_tangential && has(free, 6)) out.push_back(without(free, {6, 7}));
  return out;
}

double squares_of(const LensFit& fit) {
  double sum = 0;
  for (const Eigen::Vector2d& r : residuals(fit.data, fit.state)) sum += r.squaredNorm();
  return sum;
}

bool is_sound(const LensFit& fit) { return can_be_a_lens(shape_of(fit.state.camera)); }

/// The images say what all free numbers are: taking one away that is small, but there, would move
/// the others by more than their sigma.
bool is_determined(const LensFit& fit) {
  const auto sure = uncertainty_of(fit.data, fit.state, fit.free, fit.sigma_px);
  return sure.determined &&
         std::sqrt(sure.covariance(0, 0)) < kDeterminedFocal * fit.state.camera.fu;
}

struct Step {
  LensFit fit;
  double lost{std::numeric_limits<double>::infinity()};  ///< Per term, in variances of a residual.
  bool sound{false};
};

/// The simpler fit that loses least; one that can be a lens goes before one that cannot.
std::optional<Step> best_step(const LensFit& fit) {
  const auto sure = uncertainty_of(fit.data, fit.state, fit.free, fit.sigma_px);
  const double variance = fit.sigma_px * fit.sigma_px * std::max(1.0, sure.correlation);
  const double squares = squares_of(fit);
  std::optional<Step> best;
  for (const Numbers& free : simpler_than(fit.free, fit.state.camera.distortion)) {
    Step step{refit(fit, free)};
    const auto terms = static_cast<double>(fit.free.size() - free.size());
    step.lost = sure.determined ? (squares_of(step.fit) - squares) / variance / terms : 0;
    step.sound = is_sound(step.fit);
    const bool better = !best || (step.sound && !best->sound) ||
                        (step.sound == best->sound && step.lost < best->lost);
    if (better) best = std::move(step);
  }
  return best;
}

LensFit with_third_radial(LensFit fit) {
  if (fit.state.camera.distortion != Distortion::kRadialTangential) return fit;
  LensFit freer = fit_third_radial(fit);
  const auto sure = uncertainty_of(freer.data, freer.state, freer.free, freer.sigma_px);
  const double k3 = freer.state.camera.coefficients[4];
  const bool significant =
      sure.determined && std::abs(k3) > kThirdRadial_sigma * std::sqrt(sure.covariance(8, 8));
  return significant && is_sound(freer) ? freer : fit;
}

}  // namespace

LensFit with_supported_terms(LensFit fit) {
  fit = with_third_radial(std::move(fit));
  for (;;) {
    if (is_sound(fit) && is_determined(fit)) return fit;
    auto step = best_step(fit);
    if (!step) return fit;
    if (is_sound(fit) && (step->lost > kPerTerm || !step->sound)) return fit;
    fit = std::move(step->fit);
  }
}

}  // namespace fiducap
