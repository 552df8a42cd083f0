#include "calibration/intrinsics/intrinsics_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/lens_fit.hpp"
#include "calibration/intrinsics/lens_shape.hpp"
#include "calibration/intrinsics/lens_terms.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kLeastViews = 5;
constexpr std::size_t kLeastPoints = 60;
// Lenses that leave as little as this much more than the best one are as good: the one with fewer
// numbers is taken.
constexpr double kAsGood = 1.01;

const char* words_for(Distortion kind) {
  return kind == Distortion::kEquidistant ? "equidistant" : "radial-tangential";
}

std::size_t targets_seen(const CalibrationData& data) {
  std::set<int> seen;
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& s : view.sightings) seen.insert(s.target);
  return seen.size();
}

std::size_t views_used(const CalibrationData& data) {
  return static_cast<std::size_t>(
      std::count_if(data.views.begin(), data.views.end(),
                    [](const CalibrationView& view) { return !view.sightings.empty(); }));
}

std::optional<LensFit> fit_lens(const CalibrationData& data, Distortion kind, bool join,
                                const std::function<void(const std::string&)>& progress) {
  progress(std::string("fitting a ") + words_for(kind) + " lens");
  auto fit = fit_loose(data, kind);
  if (!fit) return std::nullopt;
  if (join && targets_seen(fit->data) > 1) {
    progress(std::string("fitting a ") + words_for(kind) + " lens and the places of the tags");
    fit = fit_joined(*fit);
  }
  return with_supported_terms(std::move(*fit));
}

LensTrial trial_of(const LensFit& fit) {
  return {fit.state.camera.distortion, fit.free, fit.sigma_px,
          can_be_a_lens(shape_of(fit.state.camera))};
}

/// A lens that had to throw away what another could explain is worse than its residuals.
double badness(const LensFit& fit, std::size_t most_points) {
  return fit.sigma_px * static_cast<double>(most_points) /
         static_cast<double>(std::max<std::size_t>(count_points(fit.data), 1));
}

/// The one that can be a lens before one that cannot, the one that explains more before the other,
/// and of those that explain as much the simpler one.
std::size_t best_of(const std::vector<LensFit>& fits, std::size_t most_points) {
  const auto sound = [](const LensFit& fit) { return can_be_a_lens(shape_of(fit.state.camera)); };
  std::size_t best = 0;
  for (std::size_t i = 1; i < fits.size(); ++i) {
    const LensFit& a = fits[i];
    const LensFit& b = fits[best];
    if (sound(a) != sound(b)) {
      best = sound(a) ? i : best;
      continue;
    }
    const double ratio = badness(a, most_points) / badness(b, most_points);
    const bool as_good = ratio < kAsGood && ratio > 1 / kAsGood;
    if (as_good ? a.free.size() < b.free.size() : ratio < 1) best = i;
  }
  return best;
}

IntrinsicsCalibration result_of(LensFit fit) {
  IntrinsicsCalibration out;
  out.held_out = hold_out(fit);
  out.shape = look_at_shape(fit.data, fit.state, fit.free);
  for (const int t : fit.misfits)
    out.misfits.push_back(fit.data.targets[static_cast<std::size_t>(t)].name);
  out.residuals = residuals(fit.data, fit.state);
  out.uncertainty = uncertainty_of(fit.data, fit.state, fit.free, fit.sigma_px);
  out.sigma_px = fit.sigma_px;
  out.free = fit.free;
  out.rejected = fit.rejected;
  out.targets_stood_still = fit.joined;
  out.targets_disagree = fit.disagree;
  out.joined_sigma_px = fit.joined_sigma_px;
  out.state = std::move(fit.state);
  out.data = std::move(fit.data);
  return out;
}

std::string what_there_is(const CalibrationData& data) {
  return std::to_string(views_used(data)) + " images with " + std::to_string(count_points(data)) +
         " corners";
}

}  // namespace

Expected<IntrinsicsCalibration> calibrate_intrinsics(
    const CalibrationData& data, const IntrinsicsOptions& options,
    const std::function<void(const std::string&)>& progress) {
  if (views_used(data) < kLeastViews || count_points(data) < kLeastPoints)
    return fail(ErrorCode::kInvalid, "too little to calibrate from: " + what_there_is(data) +
                                         ", wanted are at least " + std::to_string(kLeastViews) +
                                         " and " + std::to_string(kLeastPoints) +
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
    return fail(ErrorCode::kInvalid,
                "no camera explains these " + what_there_is(data) +
                    ": is the target what was said (family, rows, columns, gap), and is it flat?");
  std::swap(fits.front(), fits[best_of(fits, most_points)]);
  std::vector<LensTrial> trials;
  for (const LensFit& fit : fits) trials.push_back(trial_of(fit));
  IntrinsicsCalibration best = result_of(std::move(fits.front()));
  best.trials = std::move(trials);
  if (!best.uncertainty.determined)
    return fail(
        ErrorCode::kInvalid,
        "these images do not determine the lens: tilt the board or the camera to all sides, "
        "and bring it to all parts of the image");
  return best;
}

}  // namespace fiducap
