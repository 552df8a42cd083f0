#include "estimation/world/calibration_monitor.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "capture/lens/camera_model.hpp"

// Exchange of priors. CalibrationMonitor: reports, and tests after an exchange with the map.
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
// Held tags may have only a common error.
constexpr double kRelativeRounding = 1e-9;

/// A column of the covariance in two parts.
struct Column {
  Eigen::VectorXd given_held;  ///< Conditional on the held tags; theirs: zero.
  Eigen::VectorXd by_held;     ///< By the uncertainty of the held tags.
};

Column column_of(const FilterState& state, int column) {
  const auto P = state.P();
  Column out{P.col(column), Eigen::VectorXd::Zero(P.rows())};
  std::vector<int> held;
  for (const int at : state.held_tags())
    for (int i = 0; i < layout::kPoseSize; ++i) held.push_back(at + i);
  if (held.empty()) return out;
  const auto count = static_cast<Eigen::Index>(held.size());
  Eigen::MatrixXd with_held(P.rows(), count);
  for (Eigen::Index i = 0; i < count; ++i) with_held.col(i) = P.col(held[i]);
  Eigen::MatrixXd of_held(count, count);
  Eigen::VectorXd given(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    of_held.row(i) = with_held.row(held[i]);
    given[i] = P(held[i], column);
  }
  of_held.diagonal() *= 1 + kRelativeRounding;
  out.by_held = with_held * of_held.ldlt().solve(given);
  for (Eigen::Index i = 0; i < count; ++i) out.by_held[held[i]] = given[i];
  out.given_held -= out.by_held;
  return out;
}
}  // namespace

double information_of(const FilterState& state, int column, double prior_sigma) {
  const double variance = state.P()(column, column);
  return variance > 0 ? 1 / variance - 1 / (prior_sigma * prior_sigma) : 0.0;
}

void exchange_prior(FilterState& state, int camera, int column, double value, double from_sigma,
                    double to_sigma) {
  const double gained = 1 / (to_sigma * to_sigma) - 1 / (from_sigma * from_sigma);
  const Column of = column_of(state, column);
  const double S = 1 + gained * of.given_held(column);
  if (!(S > 1e-9)) return;
  const double factor = gained / S;
  const double by_held = of.by_held(column);
  auto P = state.P();
  for (Eigen::Index k = 0; k < P.cols(); ++k) {
    const double own = factor * (1 - factor * by_held) * of.given_held(k) + factor * of.by_held(k);
    P.col(k) -= own * of.given_held + factor * of.given_held(k) * of.by_held;
  }
  const Eigen::VectorXd correction = -factor * value * of.given_held;
  state.add_error(correction);
  transport_covariance(state, correction, camera);
}

void widen(FilterState& state, int column, double sigma, const std::vector<int>& closed) {
  auto P = state.P();
  const double variance = P(column, column);
  if (!(variance > 0) || sigma * sigma <= variance) return;
  const Column of = column_of(state, column);
  if (!(of.given_held(column) > 0)) return;
  Eigen::VectorXd along = of.given_held / of.given_held(column);
  for (const int other : closed) along(other) = 0;
  P += (sigma * sigma - variance) * along * along.transpose();
}

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
  for (int c = 0; c < state.cameras() && state.has_tested_parameters(); ++c) {
    const LensEstimate now = lens(state, c);
    if (!is_refined(c) || is_as_calibrated(state, c) || now.focal_sigma > kRefinedFocal ||
        now.centre_sigma_px.maxCoeff() > kRefinedCentre_px ||
        (now.focal_sigma == 0 && now.k1_sigma > kRefinedDistortion))
      continue;
    out.push_back({Kind::kLens, c, -1, now.offset.focal, now.focal_sigma, now});
  }
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
    if (!is_wrong || one.is_refined || one.assumed_sigma > 0 || state.parameter_tests[i].is_open)
      continue;
    // Without its earlier information, which was relative to other tag poses.
    state.parameter_tests[i] = {.is_open = true};
    state.clear_column(one.column, one.sigmas.open);
    is_new = true;
  }
  if (!map.is_judged) return is_new;
  state.judged_until = state.time + kJudgementHolds;
  reset_tests(state, kLikely_sigma);
  return is_new;
}

void CalibrationMonitor::reset_tests(FilterState& state, double from_sigma) const {
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    const bool is_free = one.print >= 0 && watched_tag(state, one) < 0;
    if (one.is_refined || one.assumed_sigma > 0 || is_free || state.parameter_tests[i].is_open ||
        std::abs(score(state, one)) < from_sigma)
      continue;
    error(one.column) = -value(state, one);
    state.clear_column(one.column, one.sigmas.tight);
    state.parameter_tests[i] = {};
  }
  state.add_error(error);
}

}  // namespace fiducap::world
