#include "calibration/intrinsics/intrinsics_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/lens_model.hpp"
#include "capture/lens/calibration_files.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMinPoints = 60;
// Lenses with residuals up to this ratio are equally good: the one with fewer parameters is used.
constexpr double kAsGood = 1.01;
// Smallest significance of k3, which extrapolates badly outside of the observed part.
constexpr double kThirdRadial_sigma = 5;
// Decrease of the chi-square that one term must explain: two sigma.
constexpr double kPerTerm = 4;
constexpr double kKept = 0.95;
// Relative sigma of the focal length below which the distortion is determined as well.
constexpr double kDeterminedFocal = 0.01;

/// All parameters of a radial-tangential lens, of which start values are known, and of a rational
/// one.
const std::vector<int> kThirdRadial{0, 1, 2, 3, 4, 5, 6, 7, 8};
const std::vector<int> kAllOfRational{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};

auto targets_seen(const CalibrationData& data) {
  return std::ranges::count_if(count_sightings(data), [](int sightings) { return sightings > 0; });
}

auto views_used(const CalibrationData& data) {
  return std::ranges::count_if(data.views, [](const auto& v) { return !v.sightings.empty(); });
}

using Numbers = std::vector<int>;

bool has(const Numbers& free, int number) { return std::ranges::count(free, number) > 0; }

Numbers without(Numbers free, std::initializer_list<int> gone) {
  std::erase_if(free, [&](int number) { return std::ranges::count(gone, number) > 0; });
  return free;
}

/// One term fewer: the highest order, or both tangential ones.
std::vector<Numbers> simpler_than(const Numbers& free, Distortion kind) {
  std::vector<Numbers> out;
  const bool equidistant = kind == Distortion::kEquidistant;
  const Numbers orders = equidistant ? Numbers{7, 6, 5, 4} : Numbers{8, 5, 4};
  for (const int order : orders) {
    if (!has(free, order)) continue;
    out.push_back(without(free, {order}));
    break;
  }
  if (!equidistant && has(free, 6)) out.push_back(without(free, {6, 7}));
  return out;
}

double squares_of(const LensFit& fit) {
  double sum = 0;
  for (const Eigen::Vector2d& r : residuals(fit.data, fit.state)) sum += r.squaredNorm();
  return sum;
}

bool is_plausible(const LensFit& fit) { return can_be_a_lens(shape_of(fit.state.camera)); }

/// All free parameters are determined: removing a small one would change the others by more than
/// their sigma.
bool is_determined(const LensFit& fit) {
  const auto uncertainty = uncertainty_of(fit.data, fit.state, fit.free, fit.sigma_px);
  return uncertainty.determined &&
         std::sqrt(uncertainty.covariance(0, 0)) < kDeterminedFocal * fit.state.camera.fu;
}

struct Step {
  LensFit fit;
  double lost{std::numeric_limits<double>::infinity()};  ///< Increase of the chi-square per term.
  bool sound{false};
};

/// The simpler fit with the smallest increase of the chi-square; plausible lenses first.
std::optional<Step> best_step(const LensFit& fit) {
  const auto uncertainty = uncertainty_of(fit.data, fit.state, fit.free, fit.sigma_px);
  const double variance = fit.sigma_px * fit.sigma_px * std::max(1.0, uncertainty.correlation);
  const double squares = squares_of(fit);
  std::optional<Step> best;
  for (const Numbers& free : simpler_than(fit.free, fit.state.camera.distortion)) {
    Step step{refit(fit, free)};
    const auto terms = static_cast<double>(fit.free.size() - free.size());
    step.lost = uncertainty.determined ? (squares_of(step.fit) - squares) / variance / terms : 0;
    step.sound = is_plausible(step.fit);
    const bool better = !best || (step.sound && !best->sound) ||
                        (step.sound == best->sound && step.lost < best->lost);
    if (better) best = std::move(step);
  }
  return best;
}

LensFit with_third_radial(LensFit fit) {
  LensFit freer = fit_freer(fit, kThirdRadial);
  const auto uncertainty = uncertainty_of(freer.data, freer.state, freer.free, freer.sigma_px);
  const double k3 = freer.state.camera.coefficients[4];
  const bool significant =
      uncertainty.determined &&
      std::abs(k3) > kThirdRadial_sigma * std::sqrt(uncertainty.covariance(8, 8));
  return significant && is_plausible(freer) ? freer : fit;
}

/// All terms of a rational lens, where together they explain more than chance. Numerator and
/// denominator nearly cancel: images do not determine each of them alone, and both may pass through
/// zero beyond the corners seen. The weakest prior is used that gives a lens.
std::optional<LensFit> with_denominator(const LensFit& fit) {
  constexpr std::array kSigmas{20.0, 6.0, 2.0};  // coefficients of real lenses are up to 20
  for (const double sigma : kSigmas) {
    LensFit freer = fit;
    freer.state.coefficient_sigma = sigma;
    freer = fit_freer(freer, kAllOfRational);
    const auto terms = static_cast<double>(freer.free.size() - fit.free.size());
    const double variance = freer.sigma_px * freer.sigma_px;
    const double gain = (squares_of(fit) - squares_of(freer)) / variance / terms;
    // Smaller residuals reject a few sightings more.
    const bool kept_points = static_cast<double>(count_points(freer.data)) >=
                             kKept * static_cast<double>(count_points(fit.data));
    if (kept_points && gain > kPerTerm && is_plausible(freer) && is_determined(freer)) return freer;
  }
  return std::nullopt;
}

/// Keeps the distortion terms that the images support. Frees the third radial coefficient of a
/// radial-tangential lens where it is significant; a rational lens without a significant
/// denominator is a radial-tangential one. When the
/// images do not determine the lens, fixes terms at zero that explain little, or whose removal
/// makes the lens plausible (can_be_a_lens): undetermined high orders fit the corners and fold the
/// rest of the image.
LensFit with_supported_terms(LensFit fit) {
  if (fit.state.camera.distortion == Distortion::kRational) {
    if (auto whole = with_denominator(fit)) return *std::move(whole);
    fit.state.camera.distortion = Distortion::kRadialTangential;
  }
  if (fit.state.camera.distortion == Distortion::kRadialTangential)
    fit = with_third_radial(std::move(fit));
  for (;;) {
    if (is_plausible(fit) && is_determined(fit)) return fit;
    auto step = best_step(fit);
    if (!step) return fit;
    if (is_plausible(fit) && (step->lost > kPerTerm || !step->sound)) return fit;
    fit = std::move(step->fit);
  }
}

std::optional<LensFit> fit_lens(const CalibrationData& data, Distortion kind, bool join,
                                const std::function<void(const std::string&)>& progress) {
  progress("fitting a " + name_of(kind) + " lens");
  auto fit = fit_separate(data, kind);
  if (!fit) return std::nullopt;
  if (join && targets_seen(fit->data) > 1) {
    progress("fitting a " + name_of(kind) + " lens and the poses of the tags");
    fit = fit_joined(*fit);
  }
  return with_supported_terms(std::move(*fit));
}

LensTrial trial_of(const LensFit& fit) {
  return {fit.state.camera.distortion, fit.free, fit.sigma_px, is_plausible(fit)};
}

/// Residuals with a penalty for points that another lens explained and this one rejected.
double penalised_sigma(const LensFit& fit, std::size_t most_points) {
  return fit.sigma_px * static_cast<double>(most_points) /
         static_cast<double>(std::max<std::size_t>(count_points(fit.data), 1));
}

/// Plausible lenses first, then smaller residuals; of equally good ones the simpler one.
std::size_t best_of(const std::vector<LensFit>& fits, std::size_t most_points) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < fits.size(); ++i) {
    const LensFit& a = fits[i];
    const LensFit& b = fits[best];
    if (is_plausible(a) != is_plausible(b)) {
      best = is_plausible(a) ? i : best;
      continue;
    }
    const double ratio = penalised_sigma(a, most_points) / penalised_sigma(b, most_points);
    const bool as_good = ratio < kAsGood && ratio > 1 / kAsGood;
    if (as_good ? a.free.size() < b.free.size() : ratio < 1) best = i;
  }
  return best;
}

IntrinsicsCalibration result_of(LensFit fit) {
  IntrinsicsCalibration out;
  out.held_out = hold_out(fit);
  out.shape = estimate_target_shape(fit.data, fit.state, fit.free);
  out.residuals = residuals(fit.data, fit.state);
  out.uncertainty = uncertainty_of(fit.data, fit.state, fit.free, fit.sigma_px);
  static_cast<LensFit&>(out) = std::move(fit);
  return out;
}

std::string summary_of(const CalibrationData& data) {
  return std::to_string(views_used(data)) + " images with " + std::to_string(count_points(data)) +
         " corners";
}

}  // namespace

Expected<IntrinsicsCalibration> calibrate_intrinsics(
    const CalibrationData& data, const IntrinsicsOptions& options,
    const std::function<void(const std::string&)>& progress) {
  if (views_used(data) < kFewestViews || count_points(data) < kMinPoints)
    return fail(ErrorCode::kInvalid, "too few data: " + summary_of(data) +
                                         ", needed are at least " + std::to_string(kFewestViews) +
                                         " and " + std::to_string(kMinPoints) +
                                         "; 50 different images make a good calibration");
  std::vector<LensFit> fits;
  std::size_t most_points = 0;
  for (const Distortion kind : options.lenses) {
    if (auto fit = fit_lens(data, kind, options.join_targets, progress)) {
      most_points = std::max(most_points, count_points(fit->data));
      fits.push_back(std::move(*fit));
    }
  }
  if (fits.empty())
    return fail(
        ErrorCode::kInvalid,
        "no camera explains these " + summary_of(data) +
            ": does the target have the given family, rows, columns and gap, and is it flat?");
  std::swap(fits.front(), fits[best_of(fits, most_points)]);
  std::vector<LensTrial> trials;
  for (const LensFit& fit : fits) trials.push_back(trial_of(fit));
  IntrinsicsCalibration best = result_of(std::move(fits.front()));
  best.trials = std::move(trials);
  if (!best.uncertainty.determined)
    return fail(ErrorCode::kInvalid,
                "these images do not determine the lens: tilt the board or the camera to all "
                "sides, and bring it to all parts of the image");
  return best;
}

}  // namespace fiducap
