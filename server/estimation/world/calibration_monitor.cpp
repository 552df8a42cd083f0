#include "estimation/world/calibration_monitor.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap::world {

namespace {
using Kind = FoundMismatch::Kind;

// Tight priors are without effect but sufficient for a test: 2e-4 of the focal length would change
// the heading along a loop by milliradians, 5e-5 of distortion costs 3 % of accuracy with sharp
// corners. Open ones cover a guessed lens, a careless print and a cheap camera.
constexpr ParameterSigmas kAllSizes{4e-4, 0.05, 5e-4};
constexpr ParameterSigmas kOneSize{4e-4, 0.1, 5e-4};
constexpr ParameterSigmas kFocal{5e-5, 0.05, 1e-3};
constexpr ParameterSigmas kCentre_px{0.1, 20.0, 0.5};
constexpr ParameterSigmas kDistortion{1e-5, 0.1, 2e-3};
constexpr ParameterSigmas kReadout_s{5e-5, 0.02, 3e-4};
// Assumed error of a tag size measured with a ruler, 1-sigma.
constexpr double kAssumedScale = 3e-3;
// Tight prior of an assumed error, as a share of it: without effect, but gives the correlation.
constexpr double kHeldShare = 1e-3;

constexpr double kOpen_sigma = 5.0;
constexpr int kOpenImages = 20;
// Smallest sigma of a newly opened parameter relative to its value: earlier images were gated, and
// tags initialised, with the wrong value.
constexpr double kUnsureShare = 0.5;
constexpr double kClosed_sigma = 2.0;
constexpr int kLeastOpenImages = 100;
// Fewest tags of an image that may correct a lens without an IMU: the tilt of a single tag is
// nonlinear and would change the lens.
constexpr std::size_t kTagsToSeeALens = 3;
// Sigma and score of a confirmed tag size, which is not watched any more.
constexpr double kConfirmed = 5e-4;
constexpr double kConfirmed_sigma = 3.0;
// Sigmas of a confirmed camera relative to those for closing.
constexpr double kConfirmedSettled = 5.0;

bool is_of_lens(Kind kind) {
  return kind == Kind::kFocalLength || kind == Kind::kCentreU || kind == Kind::kCentreV ||
         kind == Kind::kDistortion;
}

/// The configured sigma, or the usual one for a lens to be refined.
double configured_or(double configured_sigma, bool is_refined, double usual_sigma) {
  return configured_sigma > 0 ? configured_sigma : (is_refined ? usual_sigma : 0.0);
}
}  // namespace

void CalibrationMonitor::begin(FilterState& state) {
  all_.clear();
  for (int c = 0; c < state.cameras(); ++c) {
    add_lens(c);
    if (rules_.doubts && cameras_[static_cast<std::size_t>(c)].readout_sigma_s == 0 &&
        !state.clocks[static_cast<std::size_t>(c)].rows_apart)
      all_.push_back({Kind::kReadout, c, -1, layout::readout(c), kReadout_s});
  }
  if (rules_.doubts || rules_.assumes)
    all_.push_back({Kind::kAllPrints, -1, -1, layout::sizes(state.cameras()), kAllSizes});
  if (rules_.assumes) assume(all_.back(), kAssumedScale);
  for (const Parameter& parameter : all_)
    state.clear_column(parameter.column,
                       parameter.is_refined ? parameter.sigmas.open : parameter.sigmas.tight);
  for (int k = 0; rules_.doubts && k < layout::kWatchedPrints; ++k) {
    all_.push_back({Kind::kOnePrint, -1, k, layout::print(state.cameras(), k), kOneSize});
  }
  state.parameter_tests.assign(all_.size(), {});
  for (std::size_t i = 0; i < all_.size(); ++i)
    state.parameter_tests[i].is_open = all_[i].is_refined;
}

void CalibrationMonitor::assume(Parameter& parameter, double sigma) {
  parameter.assumed_sigma = sigma;
  parameter.sigmas.tight = kHeldShare * sigma;
}

void CalibrationMonitor::add_lens(int camera) {
  const CameraMount& mount = cameras_[static_cast<std::size_t>(camera)];
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

void CalibrationMonitor::watch_print(FilterState& state, int tag_id) const {
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
  state.parameter_tests[room] = {};
  state.sizes.watched[static_cast<std::size_t>(all_[room].print)] = {tag_id, 0.0};
  state.clear_column(all_[room].column, kOneSize.tight);
}

double CalibrationMonitor::value(const FilterState& state, const Parameter& parameter) {
  const auto camera = static_cast<std::size_t>(std::max(0, parameter.camera));
  switch (parameter.kind) {
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
    default:
      return state.sizes.watched[static_cast<std::size_t>(parameter.print)].scale;
  }
}

double CalibrationMonitor::score(const FilterState& state, const Parameter& parameter) {
  if (parameter.print >= 0 && watched_tag(state, parameter) < 0) return 0;
  const double information = information_of(state, parameter.column, parameter.sigmas.tight);
  // Rounding.
  if (information * parameter.sigmas.tight * parameter.sigmas.tight < 1e-6) return 0;
  return value(state, parameter) /
         (state.P()(parameter.column, parameter.column) * std::sqrt(information));
}

bool CalibrationMonitor::update_tests(FilterState& state, int camera, double dispersion) const {
  std::size_t worst = all_.size();
  double worst_score = 0;
  const double scale = std::sqrt(std::max(1.0, dispersion));
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& parameter = all_[i];
    ParameterTest& test = state.parameter_tests[i];
    if (parameter.is_refined) continue;
    if (test.is_open) {
      ++test.images_open;
      const double sigma = std::sqrt(state.P()(parameter.column, parameter.column));
      if (test.images_open > kLeastOpenImages && sigma < parameter.sigmas.settled &&
          std::abs(value(state, parameter)) < kClosed_sigma * sigma) {
        exchange_prior(state, camera, parameter.column, value(state, parameter),
                       parameter.sigmas.open, parameter.sigmas.tight);
        test = {};
      }
      continue;
    }
    const double beyond = std::abs(score(state, parameter)) / scale;
    test.images_beyond = beyond > kOpen_sigma ? test.images_beyond + 1 : 0;
    if (beyond > worst_score) {
      worst = i;
      worst_score = beyond;
    }
  }
  // Only the parameter with the highest score: it raises those of others, sometimes earlier.
  const bool opens = worst < all_.size() &&
                     state.parameter_tests[worst].images_beyond >= kOpenImages &&
                     state.time >= state.judged_until;
  if (opens) open(state, camera, worst);
  release_confirmed_prints(state);
  return opens;
}

void CalibrationMonitor::open(FilterState& state, int camera, std::size_t parameter) const {
  const Parameter& wrong = all_[parameter];
  std::vector<std::size_t> opened;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    const Parameter& one = all_[i];
    // A lens is calibrated as a whole: with one wrong parameter the others are uncertain, too.
    const bool is_of_same_lens =
        is_of_lens(wrong.kind) && is_of_lens(one.kind) && wrong.camera == one.camera;
    if (state.parameter_tests[i].is_open || (i != parameter && !is_of_same_lens)) continue;
    exchange_prior(state, camera, one.column, value(state, one), one.sigmas.tight, one.sigmas.open);
    state.parameter_tests[i] = {.is_open = true};
    opened.push_back(i);
  }
  std::vector<int> closed;
  for (std::size_t i = 0; i < all_.size(); ++i)
    if (!state.parameter_tests[i].is_open) closed.push_back(all_[i].column);
  for (const std::size_t i : opened)
    widen(state, all_[i].column, kUnsureShare * std::abs(value(state, all_[i])), closed);
  // Its error may have raised the scores of the others.
  for (ParameterTest& other : state.parameter_tests) other.images_beyond = 0;
}

void CalibrationMonitor::open_found(FilterState& state, std::span<const WrongNumber> wrong) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    const auto is_this = [&](const WrongNumber& number) {
      return number.kind == one.kind && number.camera == one.camera;
    };
    if (one.is_refined || std::ranges::none_of(wrong, is_this)) continue;
    state.parameter_tests[i].is_open = true;
    state.clear_column(one.column, one.sigmas.open);
  }
}

std::vector<WrongNumber> CalibrationMonitor::found_wrong(const FilterState& state) const {
  std::vector<WrongNumber> out;
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    if (state.parameter_tests[i].is_open && !one.is_refined && one.camera >= 0)
      out.push_back({one.kind, one.camera});
  }
  return out;
}

void CalibrationMonitor::release_confirmed_prints(FilterState& state) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& parameter = all_[i];
    if (parameter.print < 0 || state.parameter_tests[i].is_open) continue;
    auto& watched = state.sizes.watched[static_cast<std::size_t>(parameter.print)];
    if (watched.tag_id < 0) continue;
    const double information = information_of(state, parameter.column, parameter.sigmas.tight);
    if (information < 1 / (kConfirmed * kConfirmed) ||
        std::abs(score(state, parameter)) > kConfirmed_sigma)
      continue;
    watched = {};
    state.clear_column(parameter.column, 0);
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
    const Parameter& parameter = all_[i];
    if (!is_of_lens(parameter.kind) || parameter.camera != camera ||
        !state.parameter_tests[i].is_open)
      continue;
    if (!parameter.is_refined ||
        parameter.sigmas.open >= kConfirmedSettled * parameter.sigmas.settled)
      return true;
  }
  return false;
}

bool CalibrationMonitor::are_confirmed(const FilterState& state, int camera) const {
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& parameter = all_[i];
    const bool is_another = parameter.camera >= 0 && parameter.camera != camera;
    if (parameter.print >= 0 || is_another) continue;
    const double least = kConfirmedSettled * parameter.sigmas.settled;
    if (parameter.is_refined && parameter.sigmas.open < least) continue;  // calibrated
    if (state.parameter_tests[i].is_open) return false;
    const double information = information_of(state, parameter.column, parameter.sigmas.tight);
    if (!(information * least * least > 1)) return false;
    if (std::abs(score(state, parameter)) > kLikely_sigma) return false;
  }
  return state.has_tested_parameters() && rules_.doubts;
}

Matrix6d CalibrationMonitor::unmodelled_covariance(const FilterState& state) const {
  Matrix6d out = Matrix6d::Zero();
  for (std::size_t i = 0; i < state.parameter_tests.size(); ++i) {
    const Parameter& one = all_[i];
    if (state.parameter_tests[i].is_open || !(std::abs(score(state, one)) > kLikely_sigma))
      continue;
    // Motion of the body when the parameter is opened.
    const auto p = state.P().col(one.column);
    const double gained =
        1 / (one.sigmas.open * one.sigmas.open) - 1 / (one.sigmas.tight * one.sigmas.tight);
    const double S = 1 + gained * p(one.column);
    if (!(S > 1e-9)) continue;
    const Vector6d shift = -gained / S * value(state, one) * p.head<6>();
    out += shift * shift.transpose();
  }
  for (const Parameter& parameter : all_) {
    const double held = state.P()(parameter.column, parameter.column);
    if (parameter.assumed_sigma == 0 || !(held > 0)) continue;
    const double more = parameter.assumed_sigma * parameter.assumed_sigma - held;
    const Vector6d along = state.P().col(parameter.column).head<6>() / held;
    out += std::max(0.0, more) * along * along.transpose();
  }
  return out;
}

}  // namespace fiducap::world
