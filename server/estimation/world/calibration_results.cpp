#include "estimation/world/calibration_monitor.hpp"

#include <algorithm>
#include <cmath>

#include "capture/lens/camera_model.hpp"

// CalibrationMonitor: reports, and tests after an exchange with the map.
namespace fiducap::world {

namespace {
using Kind = FoundMismatch::Kind;

// Score above which an opened parameter is reported.
constexpr double kReported_sigma = 4.0;
// Sigmas at which a refined lens is reported.
constexpr double kRefinedFocal = 5e-3;
constexpr double kRefinedCentre_px = 5.0;
constexpr double kRefinedDistortion = 0.02;  // refined alone
// Typical distance of corners from the centre, in image widths.
constexpr double kTypicalRadius = 0.25;
// Validity of a judgement by the map: longest delay of a graph of some thousand segments.
constexpr Duration kJudgementHolds = std::chrono::seconds(10);
}  // namespace

void CalibrationMonitor::list(const FilterState& state, std::vector<FoundMismatch>& out) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& parameter = all_[i];
    if (!state.parameter_tests[i].is_open || parameter.is_refined) continue;
    const double sigma = std::sqrt(state.P()(parameter.column, parameter.column));
    const double found = value(state, parameter);
    if (!(std::abs(found) > std::max(kReported_sigma * sigma, parameter.sigmas.settled))) continue;
    const int tag_id = parameter.print < 0 ? -1 : watched_tag(state, parameter);
    if (parameter.print >= 0 && tag_id < 0) continue;
    out.push_back({parameter.kind, parameter.camera, tag_id, found, sigma, {}});
  }
  for (int c = 0; c < state.cameras() && state.has_tested_parameters(); ++c)
    list_lens(state, c, out);
}

void CalibrationMonitor::list_lens(const FilterState& state, int camera,
                                   std::vector<FoundMismatch>& out) const {
  const LensEstimate now = lens(state, camera);
  if (!is_refined(camera) || is_as_calibrated(state, camera) || now.focal_sigma > kRefinedFocal ||
      now.centre_sigma_px.maxCoeff() > kRefinedCentre_px)
    return;
  if (now.focal_sigma == 0 && now.k1_sigma > kRefinedDistortion) return;
  out.push_back({Kind::kLens, camera, -1, now.offset.focal, now.focal_sigma, now});
}

/// Deviations within the sigmas of a calibration are not reported.
bool CalibrationMonitor::is_as_calibrated(const FilterState& state, int camera) const {
  if (!has_calibrated_lens(cameras_[static_cast<std::size_t>(camera)])) return false;
  return std::ranges::all_of(all_, [&](const Parameter& parameter) {
    return !parameter.is_refined || parameter.camera != camera ||
           std::abs(value(state, parameter)) < kReported_sigma * parameter.sigmas.open;
  });
}

bool CalibrationMonitor::is_refined(int camera) const {
  return std::ranges::any_of(all_, [&](const Parameter& parameter) {
    return parameter.is_refined && parameter.camera == camera;
  });
}

LensEstimate CalibrationMonitor::lens(const FilterState& state, int camera) const {
  LensEstimate out;
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& parameter = all_[i];
    if (parameter.camera != camera || !state.parameter_tests[i].is_open) continue;
    const double sigma = std::sqrt(state.P()(parameter.column, parameter.column));
    if (parameter.kind == Kind::kFocalLength) out.focal_sigma = sigma;
    if (parameter.kind == Kind::kCentreU) out.centre_sigma_px.x() = sigma;
    if (parameter.kind == Kind::kCentreV) out.centre_sigma_px.y() = sigma;
    if (parameter.kind == Kind::kDistortion) out.k1_sigma = sigma;
  }
  if (!out.is_estimated()) return out;
  out.offset = state.lenses[static_cast<std::size_t>(camera)];
  const CameraMount& mount = cameras_[static_cast<std::size_t>(camera)];
  if (mount.lens_error_px == 0) return out;
  // Systematic errors of the lens model bias its parameters and do not average out.
  const double radius_px = kTypicalRadius * mount.model.width;
  const double radius = radius_px / mount.model.fu;
  const auto no_less = [&](double& sigma, double left) {
    if (sigma > 0) sigma = std::hypot(sigma, left);
  };
  no_less(out.focal_sigma, mount.lens_error_px / radius_px);
  // To first order a shift of the centre equals a rotation of the camera.
  no_less(out.centre_sigma_px.x(), mount.lens_error_px / (radius * radius));
  no_less(out.centre_sigma_px.y(), mount.lens_error_px / (radius * radius));
  no_less(out.k1_sigma, mount.lens_error_px / (mount.model.fu * radius * radius * radius));
  return out;
}

std::vector<CalibrationMonitor::TestStatistics> CalibrationMonitor::test_statistics(
    const FilterState& state) const {
  std::vector<TestStatistics> out;
  for (const Parameter& one : all_) {
    const double information = std::max(0.0, information_of(state, one.column, one.sigmas.tight));
    out.push_back({score(state, one), information, state.P()(one.column, one.column)});
  }
  return out;
}

/// Lost information reduces the value as well, which would otherwise be many sigmas of the rest.
void CalibrationMonitor::restore_test_statistics(FilterState& state,
                                                 std::span<const TestStatistics> before) const {
  auto P = state.P();
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    if (one.is_refined || state.parameter_tests[i].is_open || !(before[i].variance > 0)) continue;
    double& variance = P(one.column, one.column);
    variance = std::max(variance, before[i].variance);
    const double left = std::max(0.0, information_of(state, one.column, one.sigmas.tight));
    const double share = before[i].information > 0 ? left / before[i].information : 0.0;
    const double kept = before[i].score * std::sqrt(std::min(1.0, share));
    error(one.column) = kept * variance * std::sqrt(left) - value(state, one);
  }
  state.add_error(error);
}

bool CalibrationMonitor::follow_map(FilterState& state, const KnownMap& map, int body_id) const {
  const bool is_new = open_by_map(state, map, body_id);
  if (!map.is_judged) return is_new;
  state.judged_until = state.time + kJudgementHolds;
  reset_tests(state, kLikely_sigma);
  return is_new;
}

bool CalibrationMonitor::open_by_map(FilterState& state, const KnownMap& map, int body_id) const {
  const auto is_wrong_lens = [&](const Parameter& one) {
    return std::ranges::any_of(map.wrong_lenses, [&](const auto& lens) {
      return lens.body_id == body_id && lens.camera == one.camera && lens.kind == one.kind;
    });
  };
  const auto is_wrong_print = [&](int tag_id) {
    return std::ranges::find(map.wrong_prints, tag_id) != map.wrong_prints.end();
  };
  for (const int tag_id : map.wrong_prints)
    if (state.find(tag_id) >= 0 && state.sizes.find(tag_id) < 0) watch_print(state, tag_id);
  bool is_new = false;
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    bool is_wrong = false;
    if (one.camera >= 0) {
      is_wrong = is_wrong_lens(one);
    } else if (one.print < 0) {
      is_wrong = is_wrong_print(KnownMap::kAllPrints);
    } else {
      const int tag_id = watched_tag(state, one);
      is_wrong = tag_id >= 0 && is_wrong_print(tag_id);
    }
    is_new |= is_wrong && reopen(state, i);
  }
  return is_new;
}

/// Opens a parameter without its earlier information, which was relative to other tag poses.
bool CalibrationMonitor::reopen(FilterState& state, std::size_t parameter) const {
  const Parameter& one = all_[parameter];
  if (one.is_refined || one.assumed_sigma > 0 || state.parameter_tests[parameter].is_open)
    return false;
  state.parameter_tests[parameter] = {.is_open = true};
  state.clear_column(one.column, one.sigmas.open);
  return true;
}

bool CalibrationMonitor::is_closed(const FilterState& state, std::size_t parameter) const {
  const Parameter& one = all_[parameter];
  const bool is_free = one.print >= 0 && watched_tag(state, one) < 0;
  const bool is_assumed = one.assumed_sigma > 0;
  return !one.is_refined && !is_assumed && !is_free && !state.parameter_tests[parameter].is_open;
}

void CalibrationMonitor::reset_tests(FilterState& state, double from_sigma) const {
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    if (!is_closed(state, i) || std::abs(score(state, one)) < from_sigma) continue;
    error(one.column) = -value(state, one);
    state.clear_column(one.column, one.sigmas.tight);
    state.parameter_tests[i] = {};
  }
  state.add_error(error);
}

}  // namespace fiducap::world
