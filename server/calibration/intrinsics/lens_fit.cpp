#include "calibration/intrinsics/lens_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/initial_state.hpp"
#include "calibration/intrinsics/lens_model.hpp"
#include "detection/observe.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kStartViews = 60;
constexpr int kRounds = 3;
constexpr double kStartHuber_px = 1.5;
// Outliers are sightings above this multiple of the median residual, and above the minimum.
constexpr double kRejectRatio = 4;
constexpr double kRejectMin_px = 0.15;
// Targets are not joined when that increases the residuals by more than this: tags that moved,
// paper that is not flat, wrong sizes. On a real fisheye 0.36 px instead of 0.17 moved the
// principal point by 5 sigma.
constexpr double kDisagreeRatio = 1.5;
constexpr double kDisagreeMin_px = 0.1;

// fu fv cu cv and four coefficients, for all lenses.
const std::vector<int> kAllNumbers{0, 1, 2, 3, 4, 5, 6, 7};
// From few parameters to all: a high order must not absorb errors of the start values.
const std::vector<std::vector<int>> kStages{{0, 1}, {0, 1, 4}, {0, 1, 2, 3, 4, 5}, kAllNumbers};

void unbend(CalibrationData& data, const CameraModel& camera) {
  for (CalibrationView& view : data.views)
    for (TargetSighting& sighting : view.sightings) {
      if (!data.target_of(sighting).fitted_sides) continue;
      for (std::size_t i = 0; i + 4 <= sighting.points.size(); i += 4) {
        TagCorners raw;
        for (std::size_t k = 0; k < 4; ++k) raw[k] = sighting.points[i + k].raw_px;
        const auto straight = unbend_corners(camera, raw);
        for (std::size_t k = 0; k < 4; ++k) sighting.points[i + k].px = straight[k];
      }
    }
}

/// Removes sightings for which `is_wrong(view, sighting)`, and poses of groups without sightings.
template <typename Wrong>
std::size_t drop(CalibrationData& data, CalibrationState& state, const Wrong& is_wrong) {
  std::size_t dropped = 0;
  for (std::size_t v = 0; v < data.views.size(); ++v) {
    auto& sightings = data.views[v].sightings;
    dropped += std::erase_if(sightings, [&](const TargetSighting& s) { return is_wrong(v, s); });
    std::erase_if(state.X_VG[v], [&](const auto& pose) {
      return std::ranges::none_of(
          sightings, [&](const TargetSighting& s) { return state.group(s) == pose.first; });
    });
  }
  return dropped;
}

double sighting_rms(const CalibrationData& data, const CalibrationState& state, std::size_t v,
                    const TargetSighting& s) {
  if (!state.X_VG[v].contains(state.group(s))) return std::numeric_limits<double>::infinity();
  return reprojection_rms_px(data.target_of(s), s, state.camera, state.X_VT(v, s), data.width);
}

std::size_t reject(CalibrationData& data, CalibrationState& state) {
  std::vector<double> all;
  for (std::size_t v = 0; v < data.views.size(); ++v)
    for (const TargetSighting& s : data.views[v].sightings)
      all.push_back(sighting_rms(data, state, v, s));
  if (all.empty()) return 0;
  const double limit = std::max(kRejectRatio * nth_smallest(all, all.size() / 2), kRejectMin_px);
  return drop(data, state, [&](std::size_t v, const TargetSighting& s) {
    return !(sighting_rms(data, state, v, s) <= limit);
  });
}

std::size_t drop_unplaced(CalibrationData& data, CalibrationState& state) {
  return drop(data, state, [&](std::size_t v, const TargetSighting& s) {
    return !state.X_VG[v].contains(state.group(s));
  });
}

/// Resets the poses of sightings that converged to the wrong one of two poses, or diverged.
void place_again(const CalibrationData& data, CalibrationState& state) {
  for (std::size_t v = 0; v < data.views.size(); ++v)
    for (const TargetSighting& s : data.views[v].sightings) {
      const auto allowed = poses_of(data.target_of(s), s, state.camera);
      if (!allowed.empty() && allowed.front().rms_px < sighting_rms(data, state, v, s))
        state.X_VG[v][state.group(s)] = allowed.front().X_VT;
    }
}

void measure(LensFit& fit) {
  const auto r = residuals(fit.data, fit.state);
  const double numbers = 2.0 * static_cast<double>(r.size());
  const double unknowns = static_cast<double>(count_unknowns(fit.state, fit.free.size()));
  const double freedom = std::max(numbers - unknowns, 1.0);
  fit.sigma_px = rms_per_coordinate(r) * std::sqrt(numbers / freedom);
}

void settle(LensFit& fit, bool each_by_itself) {
  for (int round = 0; round < kRounds; ++round) {
    unbend(fit.data, fit.state.camera);
    if (each_by_itself) place_again(fit.data, fit.state);
    split_groups(fit.data, fit.state);
    const double huber_px = round + 1 < kRounds ? kStartHuber_px : 0;
    adjust(fit.data, {fit.free, huber_px}, fit.state);
    if (round + 1 < kRounds) fit.rejected += reject(fit.data, fit.state);
  }
  measure(fit);
}

std::size_t total_sightings(const CalibrationData& data) {
  const auto counts = count_sightings(data);
  return std::accumulate(counts.begin(), counts.end(), std::size_t{0});
}

/// Targets with most of their sightings removed.
std::vector<std::string> misfits_of(const CalibrationData& kept, const CalibrationData& all) {
  constexpr int kMinSightings = 3;
  const auto left = count_sightings(kept);
  const auto there = count_sightings(all);
  std::vector<std::string> out;
  for (std::size_t t = 0; t < there.size(); ++t)
    if (there[t] >= kMinSightings && 2 * left[t] < there[t]) out.push_back(all.targets[t].name);
  return out;
}

/// Runs the stages from one focal length, with few images.
std::optional<LensFit> start_from(const CalibrationData& data, const CameraModel& camera) {
  LensFit fit;
  fit.data = data;
  fit.state = separate_state(fit.data, camera);
  for (const auto& free : kStages) {
    fit.free = free;
    unbend(fit.data, fit.state.camera);
    place_again(fit.data, fit.state);
    if (!adjust(fit.data, {free, kStartHuber_px}, fit.state)) return std::nullopt;
  }
  if (!fit.state.camera.check().empty()) return std::nullopt;
  const std::size_t before = count_points(fit.data);
  reject(fit.data, fit.state);
  measure(fit);
  // Penalises the removed share of points.
  const double kept = static_cast<double>(count_points(fit.data)) / static_cast<double>(before);
  fit.sigma_px /= std::max(kept, 0.1);
  return fit;
}

}  // namespace

std::optional<LensFit> fit_separate(const CalibrationData& data, Distortion kind) {
  CalibrationData some = data;
  some.views = thinned(data.views, kStartViews);
  std::optional<LensFit> best;
  for (const FocalStart& start : search_focal_length(some, kind)) {
    auto fit = start_from(some, start.camera);
    if (fit && (!best || fit->sigma_px < best->sigma_px)) best = std::move(fit);
  }
  if (!best) return std::nullopt;
  LensFit fit;
  fit.data = data;
  fit.free = kAllNumbers;
  unbend(fit.data, best->state.camera);
  const std::size_t before = count_points(fit.data);
  const std::size_t sightings = total_sightings(fit.data);
  fit.state = separate_state(fit.data, best->state.camera);
  fit.rejected = sightings - total_sightings(fit.data);  // no pose
  if (count_points(fit.data) * 2 < before) return std::nullopt;
  settle(fit, true);
  return fit;
}

LensFit fit_joined(const LensFit& separate) {
  LensFit fit = separate;
  fit.state = joined_state(fit.data, separate.state.camera);
  fit.rejected += drop_unplaced(fit.data, fit.state);
  split_groups(fit.data, fit.state);
  // Poses first: a rough layout must not distort the lens.
  adjust(fit.data, {{}, kStartHuber_px}, fit.state);
  settle(fit, false);
  const double limit =
      std::max(kDisagreeRatio * separate.sigma_px, separate.sigma_px + kDisagreeMin_px);
  fit.misfits = misfits_of(fit.data, separate.data);
  const bool lost_many = count_points(fit.data) * 10 < count_points(separate.data) * 8;
  fit.joined_sigma_px = fit.sigma_px;
  fit.targets_joined = fit.sigma_px <= limit && !lost_many;
  if (fit.targets_joined) return fit;
  LensFit apart = separate;
  apart.targets_disagree = true;
  apart.joined_sigma_px = fit.sigma_px;
  apart.misfits = fit.misfits;
  return apart;
}

LensFit fit_freer(const LensFit& fit, const std::vector<int>& free) {
  LensFit freer = fit;
  freer.free = free;
  settle(freer, !fit.targets_joined);
  return freer;
}

LensFit refit(const LensFit& fit, const std::vector<int>& free) {
  LensFit simpler = fit;
  simpler.free = free;
  for (int i = 4; i < kLensNumbers; ++i)
    if (std::ranges::count(free, i) == 0)
      simpler.state.camera.coefficients[static_cast<std::size_t>(i - 4)] = 0;
  adjust(simpler.data, {free}, simpler.state);
  measure(simpler);
  return simpler;
}

}  // namespace fiducap
