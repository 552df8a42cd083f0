#include "calibration/intrinsics/lens_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/focal_search.hpp"
#include "calibration/intrinsics/target_layout.hpp"
#include "calibration/intrinsics/target_poses.hpp"
#include "detection/side_bend.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kStartViews = 60;
constexpr int kRounds = 3;
constexpr double kStartHuber_px = 1.5;
// A sighting further off than this times the median one is wrong; the least keeps perfect data
// whole.
constexpr double kRejectRatio = 4;
constexpr double kRejectLeast_px = 0.15;
// Targets are not joined when that leaves more than this: besides tags that moved, paper that is
// not flat and sizes that are not as said. On a real fisheye 0.36 px instead of 0.17 moved the
// principal point by 5 sigma.
constexpr double kDisagreeRatio = 1.5;
constexpr double kDisagreeLeast_px = 0.1;

// fu fv cu cv and four coefficients, whichever the lens.
const std::vector<int> kAllNumbers{0, 1, 2, 3, 4, 5, 6, 7};
// From few numbers to all: what is far off must not be explained by a high order.
const std::vector<std::vector<int>> kStages{{0, 1}, {0, 1, 4}, {0, 1, 2, 3, 4, 5}, kAllNumbers};

CalibrationData some_views(const CalibrationData& data) {
  CalibrationData some = data;
  if (data.views.size() <= kStartViews) return some;
  some.views.clear();
  for (std::size_t i = 0; i < kStartViews; ++i)
    some.views.push_back(data.views[i * data.views.size() / kStartViews]);
  return some;
}

void unbend(CalibrationData& data, const CameraModel& camera) {
  for (CalibrationView& view : data.views)
    for (TargetSighting& sighting : view.sightings) {
      if (!data.targets[static_cast<std::size_t>(sighting.target)].fitted_sides) continue;
      for (std::size_t i = 0; i + 4 <= sighting.points.size(); i += 4) {
        std::array<Eigen::Vector2d, 4> raw;
        for (std::size_t k = 0; k < 4; ++k) raw[k] = sighting.points[i + k].raw_px;
        const auto straight = unbend_corners(camera, raw);
        for (std::size_t k = 0; k < 4; ++k) sighting.points[i + k].px = straight[k];
      }
    }
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Takes out sightings for which `is_wrong(view, sighting)`, and poses of groups that are not
/// needed any more.
template <typename Wrong>
std::size_t drop(CalibrationData& data, CalibrationState& state, const Wrong& is_wrong) {
  std::size_t dropped = 0;
  for (std::size_t v = 0; v < data.views.size(); ++v) {
    auto& sightings = data.views[v].sightings;
    dropped += std::erase_if(sightings, [&](const TargetSighting& s) { return is_wrong(v, s); });
    std::erase_if(state.X_VG[v], [&](const auto& pose) {
      return std::none_of(sightings.begin(), sightings.end(), [&](const TargetSighting& s) {
        return state.group_of[static_cast<std::size_t>(s.target)] == pose.first;
      });
    });
  }
  return dropped;
}

double sighting_rms(const CalibrationData& data, const CalibrationState& state, std::size_t v,
                    const TargetSighting& s) {
  const auto t = static_cast<std::size_t>(s.target);
  const auto group = state.X_VG[v].find(state.group_of[t]);
  if (group == state.X_VG[v].end()) return std::numeric_limits<double>::infinity();
  return reprojection_rms_px(data.targets[t], s, state.camera, group->second * state.X_GT[t],
                             data.width);
}

std::size_t reject(CalibrationData& data, CalibrationState& state) {
  std::vector<double> all;
  for (std::size_t v = 0; v < data.views.size(); ++v)
    for (const TargetSighting& s : data.views[v].sightings)
      all.push_back(sighting_rms(data, state, v, s));
  const double limit = std::max(kRejectRatio * median(all), kRejectLeast_px);
  return drop(data, state, [&](std::size_t v, const TargetSighting& s) {
    return !(sighting_rms(data, state, v, s) <= limit);
  });
}

std::size_t drop_unplaced(CalibrationData& data, CalibrationState& state) {
  return drop(data, state, [&](std::size_t v, const TargetSighting& s) {
    return !state.X_VG[v].contains(state.group_of[static_cast<std::size_t>(s.target)]);
  });
}

/// A sighting by itself may sit in the wrong one of its two poses, or have been lost on the way.
void place_again(const CalibrationData& data, CalibrationState& state) {
  for (std::size_t v = 0; v < data.views.size(); ++v)
    for (const TargetSighting& s : data.views[v].sightings) {
      const auto t = static_cast<std::size_t>(s.target);
      const auto allowed = poses_of(data.targets[t], s, state.camera);
      if (!allowed.empty() && allowed.front().rms_px < sighting_rms(data, state, v, s))
        state.X_VG[v][state.group_of[t]] = allowed.front().X_VT;
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
  std::size_t total = 0;
  for (const CalibrationView& view : data.views) total += view.sightings.size();
  return total;
}

/// Targets that lost most of their sightings.
std::vector<int> misfits_of(const CalibrationData& kept, const CalibrationData& all) {
  constexpr int kLeastSightings = 3;
  const auto counts = [](const CalibrationData& data) {
    std::vector<int> out(data.targets.size(), 0);
    for (const CalibrationView& view : data.views)
      for (const TargetSighting& s : view.sightings) ++out[static_cast<std::size_t>(s.target)];
    return out;
  };
  const auto left = counts(kept);
  const auto there = counts(all);
  std::vector<int> out;
  for (std::size_t t = 0; t < there.size(); ++t)
    if (there[t] >= kLeastSightings && 2 * left[t] < there[t]) out.push_back(static_cast<int>(t));
  return out;
}

/// The stages from one focal length; few images.
std::optional<LensFit> start_from(const CalibrationData& data, const CameraModel& camera) {
  LensFit fit;
  fit.data = data;
  fit.state = loose_state(fit.data, camera);
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
  // A start that explains only half of what is there is none.
  const double kept = static_cast<double>(count_points(fit.data)) / static_cast<double>(before);
  fit.sigma_px /= std::max(kept, 0.1);
  return fit;
}

}  // namespace

std::optional<LensFit> fit_loose(const CalibrationData& data, Distortion kind) {
  const CalibrationData some = some_views(data);
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
  fit.state = loose_state(fit.data, best->state.camera);
  fit.rejected = sightings - total_sightings(fit.data);  // those that no pose explains
  if (count_points(fit.data) * 2 < before) return std::nullopt;
  settle(fit, true);
  return fit;
}

LensFit fit_joined(const LensFit& loose) {
  LensFit fit = loose;
  fit.state = joined_state(fit.data, loose.state.camera);
  fit.rejected += drop_unplaced(fit.data, fit.state);
  split_groups(fit.data, fit.state);
  // Places first: the lens must not give way to a layout that is still rough.
  adjust(fit.data, {{}, kStartHuber_px}, fit.state);
  settle(fit, false);
  const double limit =
      std::max(kDisagreeRatio * loose.sigma_px, loose.sigma_px + kDisagreeLeast_px);
  fit.misfits = misfits_of(fit.data, loose.data);
  const bool lost_many = count_points(fit.data) * 10 < count_points(loose.data) * 8;
  fit.joined_sigma_px = fit.sigma_px;
  fit.joined = fit.sigma_px <= limit && !lost_many;
  if (fit.joined) return fit;
  LensFit apart = loose;
  apart.disagree = true;
  apart.joined_sigma_px = fit.sigma_px;
  apart.misfits = fit.misfits;
  return apart;
}

LensFit fit_third_radial(const LensFit& fit) {
  LensFit freer = fit;
  freer.free = {0, 1, 2, 3, 4, 5, 6, 7, 8};
  settle(freer, !fit.joined);
  return freer;
}

LensFit refit(const LensFit& fit, const std::vector<int>& free) {
  LensFit simpler = fit;
  simpler.free = free;
  for (int i = 4; i < kLensNumbers; ++i)
    if (std::find(free.begin(), free.end(), i) == free.end())
      simpler.state.camera.coefficients[static_cast<std::size_t>(i - 4)] = 0;
  adjust(simpler.data, {free}, simpler.state);
  measure(simpler);
  return simpler;
}

}  // namespace fiducap
