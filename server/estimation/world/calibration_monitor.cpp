#include "estimation/world/calibration_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "estimation/world/state_prior.hpp"

namespace fiducap::world {

namespace {
using Kind = FoundMismatch::Kind;

// Tight priors are without effect but sufficient for a test: 2e-4 of the focal length would change
// the heading along a loop by milliradians, 5e-5 of distortion costs 3 % of accuracy with sharp
// corners. Open ones cover a guessed lens, a print measured across its white border, a cheap
// camera, an IMU that was not calibrated (imu_part: scales of 0.5 to 3 %, axes to 1 or 2 degrees),
// and a camera by eye.
constexpr ParameterSigmas kSize{4e-4, 0.15, 5e-4};
constexpr ParameterSigmas kFocal{5e-5, 0.05, 1e-3};
constexpr ParameterSigmas kCentre_px{0.1, 20.0, 0.5};
constexpr ParameterSigmas kDistortion{1e-5, 0.1, 2e-3};
constexpr ParameterSigmas kReadout_s{5e-5, 0.02, 3e-4};
constexpr ParameterSigmas kAccelScale{2e-5, 0.03, 2e-3};
constexpr ParameterSigmas kGyroTurn_rad{2e-5, 0.03, 2e-3};
constexpr ParameterSigmas kGyroScale{2e-5, 0.03, 2e-3};
constexpr ParameterSigmas kGyroDrift_rad_s2{1e-7, 2e-3, 5e-5};
constexpr double kOpenMount_m = 0.05;
constexpr double kSettledMount_m = 1e-3;
constexpr double kOpenMount_rad = 0.05;
constexpr double kSettledMount_rad = 5e-4;
// Sigmas of a mount that is given as exact. Larger ones are honest: the mount is estimated anyway.
constexpr double kExactMount_m = 1e-3;
constexpr double kExactMount_rad = 2e-3;
// Assumed error of a tag size measured with a ruler, 1-sigma.
constexpr double kAssumedScale = 3e-3;
// Tight prior of an assumed error, as a share of it: without effect, but gives the correlation.
constexpr double kHeldShare = 1e-3;

constexpr double kOpen_sigma = 5.0;
constexpr int kOpenImages = 20;
constexpr int kTestEvery = 5;  // images
// Fewest tags of an image that may correct a lens without an IMU: the tilt of a single tag is
// nonlinear and would change the lens.
constexpr std::size_t kTagsToSeeALens = 3;
// Sigma and score of a confirmed tag size, which is not watched any more.
constexpr double kConfirmed = 5e-4;
constexpr double kConfirmed_sigma = 3.0;
// Sigmas of a confirmed camera relative to those of a report.
constexpr double kConfirmedSettled = 5.0;

bool is_of_lens(Kind kind) {
  return kind == Kind::kFocalLength || kind == Kind::kCentreU || kind == Kind::kCentreV ||
         kind == Kind::kDistortion;
}

/// The configured sigma, or the usual one for a lens to be refined.
double configured_or(double configured_sigma, bool is_refined, double usual_sigma) {
  return configured_sigma > 0 ? configured_sigma : (is_refined ? usual_sigma : 0.0);
}

double square(double x) { return x * x; }
}  // namespace

void CalibrationMonitor::begin(FilterState& state) {
  all_.clear();
  for (int c = 0; c < state.cameras(); ++c) {
    add_lens(c);
    if (rules_.doubts && sensors_.cameras[static_cast<std::size_t>(c)].readout_sigma_s == 0 &&
        !state.clocks[static_cast<std::size_t>(c)].rows_apart)
      all_.push_back({Kind::kReadout, c, -1, layout::readout(c), kReadout_s});
  }
  if (rules_.doubts || rules_.assumes)
    all_.push_back({Kind::kAllPrints, -1, -1, layout::sizes(state.cameras()), kSize});
  if (rules_.assumes) assume(all_.back(), kAssumedScale);
  if (rules_.doubts) add_motion(state);
  for (const Parameter& parameter : all_)
    state.clear_column(parameter.at,
                       parameter.is_refined ? parameter.sigmas.open : parameter.sigmas.closed);
  // `estimate_extrinsics: false` means exact.
  for (int c = 0; rules_.doubts && c < state.cameras(); ++c)
    if (state.P()(layout::camera(c), layout::camera(c)) > 0) add_mount(c);
  for (int k = 0; rules_.doubts && k < layout::kWatchedPrints; ++k)
    all_.push_back({Kind::kOnePrint, -1, k, layout::print(state.cameras(), k), kSize});
  list_doubts();
  state.parameter_tests.assign(all_.size(), {});
  for (std::size_t i = 0; i < all_.size(); ++i)
    state.parameter_tests[i].is_open = all_[i].is_refined;
  set_drift_prior(state);
}

void CalibrationMonitor::assume(Parameter& parameter, double sigma) {
  parameter.assumed_sigma = sigma;
  parameter.sigmas.closed = kHeldShare * sigma;
}

void CalibrationMonitor::add_lens(int camera) {
  const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(camera)];
  const double focal = configured_or(mount.focal_sigma, rules_.refines, kFocal.open);
  const double centre = configured_or(mount.centre_sigma_px, rules_.refines, kCentre_px.open);
  const double k1 = configured_or(mount.k1_sigma, rules_.refines, kDistortion.open);
  const auto add = [&](Parameter parameter, double configured_sigma, double assumed_sigma) {
    parameter.is_refined = configured_sigma > 0;
    if (parameter.is_refined) parameter.sigmas.open = configured_sigma;
    const bool is_assumed = rules_.assumes && assumed_sigma > 0;
    if (!parameter.is_refined && is_assumed) assume(parameter, assumed_sigma);
    if (parameter.is_refined || rules_.doubts || is_assumed) all_.push_back(parameter);
  };
  add({Kind::kFocalLength, camera, -1, layout::focal(camera), kFocal}, focal, kAssumedFocal);
  const int at = layout::centre(camera);
  add({Kind::kCentreU, camera, -1, at, kCentre_px}, centre, kAssumedCentre_px);
  add({Kind::kCentreV, camera, -1, at + 1, kCentre_px}, centre, kAssumedCentre_px);
  add({Kind::kDistortion, camera, -1, layout::distortion(camera), kDistortion}, k1, 0);
}

void CalibrationMonitor::add_mount(int camera) {
  const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(camera)];
  const bool is_exact =
      mount.position_sigma_m <= kExactMount_m && mount.rotation_sigma_rad <= kExactMount_rad;
  const auto add = [&](Kind kind, double sigma, double open, double settled) {
    for (int axis = 0; is_exact && sigma > 0 && axis < 3; ++axis)
      all_.push_back({kind, camera, -1, axis, {sigma, open, settled}});
  };
  add(Kind::kMountPosition, mount.position_sigma_m, kOpenMount_m, kSettledMount_m);
  add(Kind::kMountRotation, mount.rotation_sigma_rad, kOpenMount_rad, kSettledMount_rad);
}

void CalibrationMonitor::add_motion(const FilterState& state) {
  const int cameras = state.cameras();
  const auto add = [&](Kind kind, int at, const ParameterSigmas& sigmas) {
    for (int axis = 0; axis < 3; ++axis) all_.push_back({kind, -1, -1, at + axis, sigmas});
  };
  add(Kind::kAccelScale, layout::accel_scale(cameras), kAccelScale);
  add(Kind::kGyroTurn, layout::gyro_turn(cameras), kGyroTurn_rad);
  add(Kind::kGyroScale, layout::gyro_scale(cameras), kGyroScale);
  add(Kind::kGyroDrift, layout::gyro_drift(cameras), kGyroDrift_rad_s2);
}

bool CalibrationMonitor::is_same_group(const Parameter& a, const Parameter& b) {
  if (a.camera != b.camera || a.print != b.print) return false;
  return a.kind == b.kind || (is_of_lens(a.kind) && is_of_lens(b.kind)) ||
         (a.is_of_mount() && b.is_of_mount());
}

void CalibrationMonitor::list_doubts() {
  doubts_.clear();
  for (std::size_t i = 0; i < all_.size(); ++i) {
    if (all_[i].is_refined || all_[i].assumed_sigma > 0) continue;
    const auto same = std::ranges::find_if(
        doubts_, [&](const Doubt& doubt) { return is_same_group(all_[doubt.rows[0]], all_[i]); });
    Doubt& doubt = same == doubts_.end() ? doubts_.emplace_back() : *same;
    doubt.rows[static_cast<std::size_t>(doubt.count++)] = i;
  }
}

void CalibrationMonitor::watch_print(FilterState& state, int tag_id, bool is_doubted) const {
  if (!state.has_tested_parameters() || !rules_.doubts) return;
  // A free slot, or that of the tag unseen for longest without a likely error. (The error of a
  // visible tag that is not watched would be attributed to its neighbours.)
  std::size_t room = all_.size();
  Instant longest = state.time;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    if (all_[i].print < 0) continue;
    const int watched = watched_tag(state, all_[i]);
    if (watched < 0) {
      room = i;
      break;
    }
    if (state.parameter_tests[i].is_open || std::abs(score(state, all_[i])) > kLikely_sigma)
      continue;
    const int tag = state.find(watched);
    if (tag < 0) continue;
    const Instant seen = state.tags[static_cast<std::size_t>(tag)].last_seen;
    if (seen >= longest) continue;
    longest = seen;
    room = i;
  }
  if (room == all_.size()) return;
  state.parameter_tests[room] = {.is_open = is_doubted};
  state.sizes.watched[static_cast<std::size_t>(all_[room].print)] = {tag_id, 0.0};
  state.clear_column(all_[room].at, is_doubted ? kSize.open : kSize.closed);
}

bool CalibrationMonitor::update_tests(FilterState& state, int camera, double dispersion) {
  if (++images_since_test_ < kTestEvery) return false;
  images_since_test_ = 0;
  const double scale = std::sqrt(std::max(1.0, dispersion));
  bool opens = false;
  int tested = next_camera_++ % state.cameras();
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    ParameterTest& test = state.parameter_tests[i];
    if (test.is_open || all_[i].assumed_sigma > 0) continue;
    test.score = score(state, all_[i]) / scale;
    const bool is_beyond = std::abs(test.score) > kOpen_sigma;
    test.images_beyond = is_beyond ? test.images_beyond + kTestEvery : 0;
    if (test.images_beyond < kOpenImages) continue;
    opens = true;
    if (all_[i].camera >= 0) tested = all_[i].camera;
  }
  const Likelihood of = likelihood(state, tested, scale * scale);
  if (opens) opens = set_open(state, camera, of, select(of));
  average(state, of);
  release_confirmed_prints(state);
  return opens;
}

/// Opens these of the tested parameters and closes the others. @return whether one was opened
bool CalibrationMonitor::set_open(FilterState& state, int camera, const Likelihood& of,
                                  const std::vector<std::size_t>& opened) const {
  std::vector<std::size_t> newly;
  std::vector<std::size_t> changed;
  for (const std::size_t i : std::span(of.rows).first(opened.empty() ? 0 : of.count)) {
    const bool is_open = std::ranges::find(opened, i) != opened.end();
    if (is_open == state.parameter_tests[i].is_open) continue;
    changed.push_back(i);
    if (is_open) newly.push_back(i);
  }
  change_priors(state, camera, changed);
  for (const std::size_t i : newly)
    state.parameter_tests[i].opened_with = 1 + static_cast<int>(newly.front());
  widen_opened(state, newly);
  set_drift_prior(state);
  // An error of one parameter may have raised the scores of the others.
  for (ParameterTest& other : state.parameter_tests) other.images_beyond = 0;
  return !newly.empty();
}

/// Opens closed parameters and closes open ones.
void CalibrationMonitor::change_priors(FilterState& state, int camera,
                                       const std::vector<std::size_t>& rows) const {
  if (rows.empty()) return;
  const auto k = static_cast<Eigen::Index>(rows.size());
  Numbers numbers{Eigen::MatrixXd(state.size(), k), Eigen::VectorXd(k)};
  Eigen::VectorXd from(k);
  Eigen::VectorXd to(k);
  for (Eigen::Index a = 0; a < k; ++a) {
    const std::size_t row = rows[static_cast<std::size_t>(a)];
    const ParameterSigmas& sigmas = all_[row].sigmas;
    const bool is_open = state.parameter_tests[row].is_open;
    from(a) = is_open ? sigmas.open : sigmas.closed;
    to(a) = is_open ? sigmas.closed : sigmas.open;
    state.parameter_tests[row] = {.is_open = !is_open};
    numbers.L.col(a) = derivative(state, all_[row]);
    numbers.values(a) = offset(state, all_[row]);
  }
  exchange_priors(state, camera, numbers, from, to);
}

void CalibrationMonitor::release_confirmed_prints(FilterState& state) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    if (one.print < 0 || state.parameter_tests[i].is_open) continue;
    auto& watched = state.sizes.watched[static_cast<std::size_t>(one.print)];
    if (watched.tag_id < 0) continue;
    const double information = 1 / state.P()(one.at, one.at) - 1 / square(one.sigmas.closed);
    if (information < 1 / square(kConfirmed) || std::abs(score(state, one)) > kConfirmed_sigma)
      continue;
    watched = {};
    state.clear_column(one.at, 0);
  }
}

void CalibrationMonitor::hold_parameters(FilterState& state, std::size_t tags) const {
  if (!state.has_tested_parameters()) return;
  state.hold_block(layout::sizes(state.cameras()));
  for (int c = 0; c < state.cameras(); ++c)
    if (tags < kTagsToSeeALens || !is_refined(c)) state.hold_block(layout::clock(c));
}

bool CalibrationMonitor::is_lens_open(const FilterState& state, int camera) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    if (!is_of_lens(one.kind) || one.camera != camera || !state.parameter_tests[i].is_open)
      continue;
    if (!one.is_refined || one.sigmas.open >= kConfirmedSettled * one.sigmas.settled) return true;
  }
  return false;
}

bool CalibrationMonitor::are_confirmed(const FilterState& state, int camera) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    const bool is_tested =
        is_of_lens(one.kind) || one.kind == Kind::kReadout || one.kind == Kind::kAllPrints;
    if (!is_tested || (one.camera >= 0 && one.camera != camera)) continue;
    const double least = kConfirmedSettled * one.sigmas.settled;
    if (one.is_refined && one.sigmas.open < least) continue;  // calibrated
    if (state.parameter_tests[i].is_open) return false;
    const double information = 1 / state.P()(one.at, one.at) - 1 / square(one.sigmas.closed);
    if (!(information * least * least > 1)) return false;
    if (std::abs(score(state, one)) > kLikely_sigma) return false;
  }
  return state.has_tested_parameters() && rules_.doubts;
}

Matrix6d CalibrationMonitor::unmodelled_covariance(const FilterState& state) const {
  Matrix6d out = Matrix6d::Zero();
  for (const Doubt& doubt : doubts_) {
    if (doubt.moment.isZero(0)) continue;
    // Derivative of the body by the parameters: P_xb / P_bb while their priors are tight.
    Eigen::Matrix<double, 6, kMostOfGroup> U = Eigen::Matrix<double, 6, kMostOfGroup>::Zero();
    for (int a = 0; a < doubt.count; ++a) {
      const Parameter& one = all_[doubt.rows[static_cast<std::size_t>(a)]];
      const double variance = covariance(state, one, one);
      if (variance > 0) U.col(a) = body_column(state, one) / variance;
    }
    out += U * doubt.moment * U.transpose();
  }
  for (const Parameter& parameter : all_) {
    if (parameter.assumed_sigma == 0) continue;
    const double held = state.P()(parameter.at, parameter.at);
    if (!(held > 0)) continue;
    const double more = square(parameter.assumed_sigma) - held;
    const Vector6d along = state.P().col(parameter.at).head<6>() / held;
    out += std::max(0.0, more) * along * along.transpose();
  }
  return out;
}

}  // namespace fiducap::world
