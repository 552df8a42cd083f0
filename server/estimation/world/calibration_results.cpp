#include "estimation/world/calibration_monitor.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "capture/lens/camera_model.hpp"
#include "estimation/world/state_prior.hpp"

// CalibrationMonitor: values and priors of its parameters, reports, and the map.
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

/// Derivative of one number of X_BV (position or rotation vector, B axes) by the world-side error
/// of the camera relative to the body.
Eigen::Matrix<double, 1, 6> mount_row(const FilterState& state, int camera, int row) {
  const Matrix6d J = plain_from_world_error(state.X_BV[static_cast<std::size_t>(camera)].p) *
                     adjoint(state.X_WB.inverse());
  return J.row(row);
}

int row_of(Kind kind, int axis) { return (kind == Kind::kMountRotation ? 3 : 0) + axis; }

/// A parameter with one number per axis.
bool has_axes(Kind kind) {
  return kind == Kind::kAccelScale || kind == Kind::kGyroTurn || kind == Kind::kGyroScale ||
         kind == Kind::kGyroDrift || kind == Kind::kMountPosition || kind == Kind::kMountRotation;
}
}  // namespace

double CalibrationMonitor::value(const FilterState& state, const Parameter& one) {
  const auto camera = static_cast<std::size_t>(std::max(0, one.camera));
  switch (one.kind) {
    case Kind::kFocalLength:
      return state.lenses[camera].focal;
    case Kind::kCentreU:
      return state.lenses[camera].centre_px.x();
    case Kind::kCentreV:
      return state.lenses[camera].centre_px.y();
    case Kind::kDistortion:
      return state.lenses[camera].k1;
    case Kind::kReadout:
      return state.clocks[camera].readout_s;
    case Kind::kAllPrints:
      return state.sizes.common;
    case Kind::kAccelScale:
      return state.imu.accel_scale(one.at - layout::accel_scale(state.cameras()));
    case Kind::kGyroTurn:
      return state.imu.gyro_turn(one.at - layout::gyro_turn(state.cameras()));
    case Kind::kGyroScale:
      return state.imu.gyro_scale(one.at - layout::gyro_scale(state.cameras()));
    case Kind::kGyroDrift:
      return state.imu.gyro_drift(one.at - layout::gyro_drift(state.cameras()));
    default:
      return state.sizes.watched[static_cast<std::size_t>(one.print)].scale;
  }
}

double CalibrationMonitor::value_of_mount(const FilterState& state, const Parameter& one) const {
  const auto camera = static_cast<std::size_t>(one.camera);
  const Pose& configured = sensors_.cameras[camera].X_BV;
  const Pose& now = state.X_BV[camera];
  if (one.kind == Kind::kMountPosition) return now.p(one.at) - configured.p(one.at);
  return log_so3(now.q * configured.q.conjugate())(one.at);
}

Eigen::VectorXd CalibrationMonitor::derivative(const FilterState& state, const Parameter& one) {
  Eigen::VectorXd l = Eigen::VectorXd::Zero(state.size());
  if (!one.is_of_mount()) {
    l(one.at) = 1;
    return l;
  }
  const auto row = mount_row(state, one.camera, row_of(one.kind, one.at));
  l.segment<6>(layout::camera(one.camera)) = row.transpose();
  l.head<6>() = -row.transpose();
  return l;
}

double CalibrationMonitor::covariance(const FilterState& state, const Parameter& a,
                                      const Parameter& b) {
  const auto P = state.P();
  if (!a.is_of_mount() && !b.is_of_mount()) return P(a.at, b.at);
  if (!a.is_of_mount()) return covariance(state, b, a);
  const auto row = mount_row(state, a.camera, row_of(a.kind, a.at));
  const int at = layout::camera(a.camera);
  if (!b.is_of_mount()) return row * (P.block<6, 1>(at, b.at) - P.block<6, 1>(0, b.at));
  const auto other = mount_row(state, b.camera, row_of(b.kind, b.at));
  const int there = layout::camera(b.camera);
  const Matrix6d apart = P.block<6, 6>(at, there) - P.block<6, 6>(0, there) - P.block<6, 6>(at, 0) +
                         P.block<6, 6>(0, 0);
  return row * apart * other.transpose();
}

Vector6d CalibrationMonitor::body_column(const FilterState& state, const Parameter& one) {
  const auto P = state.P();
  if (!one.is_of_mount()) return P.block<6, 1>(0, one.at);
  const auto row = mount_row(state, one.camera, row_of(one.kind, one.at));
  return (P.block<6, 6>(0, layout::camera(one.camera)) - P.block<6, 6>(0, 0)) * row.transpose();
}

double CalibrationMonitor::sigma_of(const FilterState& state, const Parameter& one) const {
  return std::sqrt(std::max(0.0, covariance(state, one, one)));
}

/// Of the data alone, in the sigmas of data and prior together.
double CalibrationMonitor::score(const FilterState& state, const Parameter& one) const {
  if (one.print >= 0 && watched_tag(state, one) < 0) return 0;
  const double variance = covariance(state, one, one);
  const double prior = one.sigmas.closed * one.sigmas.closed;
  const double information = variance > 0 ? 1 / variance - 1 / prior : 0.0;
  constexpr double kRounding = 1e-6;
  if (!(information * prior > kRounding)) return 0;
  return offset(state, one) / (variance * std::sqrt(information * (1 + information * prior)));
}

/// Makes newly opened parameters as uncertain as a share of their values: earlier images were gated
/// with the wrong ones.
void CalibrationMonitor::widen_opened(FilterState& state,
                                      const std::vector<std::size_t>& opened) const {
  constexpr double kUnsureShare = 0.5;
  Closed closed;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    if (state.parameter_tests[i].is_open) continue;
    if (all_[i].is_of_mount())
      closed.mounts.push_back(all_[i].camera);
    else
      closed.columns.push_back(all_[i].at);
  }
  for (const std::size_t i : opened)
    widen(state, derivative(state, all_[i]), kUnsureShare * std::abs(offset(state, all_[i])),
          closed);
}

void CalibrationMonitor::open_found(FilterState& state, std::span<const WrongNumber> wrong) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    const auto is_this = [&](const WrongNumber& number) {
      return number.kind == one.kind && number.camera == one.camera;
    };
    if (state.parameter_tests[i].is_open || std::ranges::none_of(wrong, is_this)) continue;
    change_priors(state, std::max(0, one.camera), {i});
  }
  set_drift_prior(state);
}

void CalibrationMonitor::set_drift_prior(FilterState& state) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const ParameterSigmas& sigmas = all_[i].sigmas;
    if (all_[i].kind == Kind::kGyroDrift)
      state.gyro_drift_sigma = state.parameter_tests[i].is_open ? sigmas.open : sigmas.closed;
  }
}

std::vector<WrongNumber> CalibrationMonitor::found_wrong(const FilterState& state) const {
  std::vector<WrongNumber> out;
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    const bool is_size = one.kind == Kind::kAllPrints || one.kind == Kind::kOnePrint;
    if (state.parameter_tests[i].is_open && !one.is_refined && !is_size)
      out.push_back({one.kind, one.camera});
  }
  return out;
}

/// Findings of the parameters that were opened together. They are ambiguous when none of them is
/// significant alone, but all of them together are.
void CalibrationMonitor::list(const FilterState& state, std::vector<FoundMismatch>& out) const {
  std::map<int, std::vector<std::size_t>> sets;
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const bool is_free = all_[i].print >= 0 && watched_tag(state, all_[i]) < 0;
    if (state.parameter_tests[i].is_open && !all_[i].is_refined && !is_free)
      sets[state.parameter_tests[i].opened_with].push_back(i);
  }
  for (const auto& [set, rows] : sets) {
    const std::size_t before = out.size();
    for (const std::size_t i : rows) add_finding(state, i, false, out);
    if (out.size() > before || !are_significant(state, rows)) continue;
    for (const std::size_t i : rows) add_finding(state, i, true, out);
  }
  for (int c = 0; c < state.cameras() && state.has_tested_parameters(); ++c) {
    const LensEstimate now = lens(state, c);
    if (!is_refined(c) || is_as_calibrated(state, c) || now.focal_sigma > kRefinedFocal ||
        now.centre_sigma_px.maxCoeff() > kRefinedCentre_px ||
        (now.focal_sigma == 0 && now.k1_sigma > kRefinedDistortion))
      continue;
    out.push_back({.kind = Kind::kLens,
                   .camera = c,
                   .value = now.offset.focal,
                   .sigma = now.focal_sigma,
                   .lens = now});
  }
}

bool CalibrationMonitor::are_significant(const FilterState& state,
                                         const std::vector<std::size_t>& rows) const {
  const auto k = static_cast<Eigen::Index>(rows.size());
  if (k < 2) return false;
  Eigen::MatrixXd P(k, k);
  Eigen::VectorXd offsets(k);
  for (Eigen::Index a = 0; a < k; ++a) {
    const Parameter& one = all_[rows[static_cast<std::size_t>(a)]];
    for (Eigen::Index b = 0; b < k; ++b)
      P(b, a) = covariance(state, one, all_[rows[static_cast<std::size_t>(b)]]);
    offsets(a) = offset(state, one);
  }
  const double square = offsets.dot(P.ldlt().solve(offsets));
  return square > kReported_sigma * kReported_sigma + 2 * static_cast<double>(k - 1);
}

/// @param is_ambiguous  whatever its significance, as one of several
void CalibrationMonitor::add_finding(const FilterState& state, std::size_t row, bool is_ambiguous,
                                     std::vector<FoundMismatch>& out) const {
  const Parameter& one = all_[row];
  const double sigma = sigma_of(state, one);
  const double found = offset(state, one);
  const double least = std::max(kReported_sigma * sigma, one.sigmas.settled);
  if (!is_ambiguous && !(std::abs(found) > least)) return;
  const int tag_id = one.print < 0 ? -1 : watched_tag(state, one);
  const auto same = std::ranges::find_if(out, [&](const FoundMismatch& other) {
    return other.kind == one.kind && other.camera == one.camera && other.tag_id == tag_id;
  });
  if (same == out.end()) {
    out.push_back({.kind = one.kind,
                   .camera = one.camera,
                   .tag_id = tag_id,
                   .value = found,
                   .sigma = sigma,
                   .is_ambiguous = is_ambiguous});
    if (!has_axes(one.kind)) return;
    // All three axes.
    const int first =
        one.is_of_mount() ? 0 : one.at - (one.at - layout::gravity(state.cameras()) - 1) % 3;
    for (int axis = 0; axis < 3; ++axis) {
      Parameter other = one;
      other.at = first + axis;
      out.back().axes(axis) = offset(state, other);
      out.back().axes_sigma(axis) = sigma_of(state, other);
    }
    return;
  }
  if (std::abs(found) <= std::abs(same->value)) return;
  same->value = found;
  same->sigma = sigma;
}

/// Deviations within the sigmas of a calibration are not reported.
bool CalibrationMonitor::is_as_calibrated(const FilterState& state, int camera) const {
  if (!has_calibrated_lens(sensors_.cameras[static_cast<std::size_t>(camera)])) return false;
  return std::ranges::all_of(all_, [&](const Parameter& parameter) {
    return !parameter.is_refined || parameter.camera != camera ||
           std::abs(offset(state, parameter)) < kReported_sigma * parameter.sigmas.open;
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
    const double sigma = std::sqrt(state.P()(parameter.at, parameter.at));
    if (parameter.kind == Kind::kFocalLength) out.focal_sigma = sigma;
    if (parameter.kind == Kind::kCentreU) out.centre_sigma_px.x() = sigma;
    if (parameter.kind == Kind::kCentreV) out.centre_sigma_px.y() = sigma;
    if (parameter.kind == Kind::kDistortion) out.k1_sigma = sigma;
  }
  if (!out.is_estimated()) return out;
  out.offset = state.lenses[static_cast<std::size_t>(camera)];
  const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(camera)];
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
    const double variance = covariance(state, one, one);
    const double prior = 1 / (one.sigmas.closed * one.sigmas.closed);
    out.push_back({score(state, one), std::max(0.0, 1 / variance - prior), variance});
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
    if (one.is_refined || one.is_of_mount() || state.parameter_tests[i].is_open ||
        !(before[i].variance > 0))
      continue;
    double& variance = P(one.at, one.at);
    variance = std::max(variance, before[i].variance);
    const double left = std::max(0.0, 1 / variance - 1 / (one.sigmas.closed * one.sigmas.closed));
    const double share = before[i].information > 0 ? left / before[i].information : 0.0;
    const double kept = before[i].score * std::sqrt(std::min(1.0, share));
    const double scale = std::sqrt(left * (1 + left * one.sigmas.closed * one.sigmas.closed));
    error(one.at) = kept * variance * scale - value(state, one);
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
      is_wrong = !one.is_of_mount() && is_wrong_lens(one);
    } else if (one.kind == Kind::kAllPrints) {
      is_wrong = is_wrong_print(KnownMap::kAllPrints);
    } else if (one.print >= 0) {
      const int tag_id = watched_tag(state, one);
      is_wrong = tag_id >= 0 && is_wrong_print(tag_id);
    }
    if (!is_wrong || one.is_refined || one.assumed_sigma > 0 || state.parameter_tests[i].is_open)
      continue;
    // Without its earlier information, which was relative to other tag poses.
    state.parameter_tests[i] = {.is_open = true};
    state.clear_column(one.at, one.sigmas.open);
    is_new = true;
  }
  return is_new;
}

void CalibrationMonitor::reset_tests(FilterState& state) const {
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    const bool is_free = one.print >= 0 && watched_tag(state, one) < 0;
    if (one.is_refined || one.is_of_mount() || one.assumed_sigma > 0 || is_free ||
        state.parameter_tests[i].is_open)
      continue;
    error(one.at) = -value(state, one);
    state.clear_column(one.at, one.sigmas.closed);
    state.parameter_tests[i] = {};
  }
  state.add_error(error);
}

}  // namespace fiducap::world
