#include "estimation/world/suspects.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/world/prior_exchange.hpp"

namespace fiducap::world {

namespace {

using Kind = FoundMismatch::Kind;

// While closed: less than any lab notices, enough to see where the data pull.
constexpr double kTightScale = 4e-4;
constexpr double kTightFocal = 5e-5;  // along a round trip 2e-4 bends the heading by milliradians
constexpr double kTightCentre_px = 0.1;
constexpr double kTightDistortion = 1e-5;  // 5e-5 cost 3 % of accuracy where corners are sharp
constexpr double kTightReadout_s = 5e-5;
// Assumed, 1-sigma: what a ruler tells of a print.
constexpr double kAssumedScale = 3e-3;
// Held at such a share of it, which moves nothing and tells how much it would.
constexpr double kHeldShare = 1e-3;
// Once open: what a guessed lens, a careless print or a cheap camera is off.
constexpr double kOpenCommon = 0.05;
constexpr double kOpenPrint = 0.1;
constexpr double kOpenFocal = 0.05;
constexpr double kOpenCentre_px = 20.0;
constexpr double kOpenDistortion = 0.1;
constexpr double kOpenReadout_s = 0.02;
// As configured after all, when it is known to be so to this, 1-sigma.
constexpr double kSettledScale = 5e-4;
constexpr double kSettledFocal = 1e-3;
constexpr double kSettledCentre_px = 0.5;
constexpr double kSettledDistortion = 2e-3;
constexpr double kSettledReadout_s = 3e-4;

constexpr double kOpen_sigma = 5.0;
constexpr int kOpenImages = 20;
// What a number is, once it is known to be wrong, is known to such a share of it at best: until
// then images were gated, and tags placed, by the wrong one. What comes from here on decides.
constexpr double kUnsureShare = 0.5;
constexpr double kClosed_sigma = 2.0;
constexpr int kLeastOpenImages = 100;
// A lone print that the data know this well and do not accuse is cleared; the next one is watched.
constexpr double kCleared = 5e-4;
constexpr double kCleared_sigma = 3.0;
// A camera is cleared when its numbers are known to so many times what would close them.
constexpr double kClearedSettled = 5.0;
bool is_of_lens(Kind kind) {
  return kind == Kind::kFocalLength || kind == Kind::kCentreU || kind == Kind::kCentreV ||
         kind == Kind::kDistortion;
}

/// What may be off when it is not told: as much as of one that turned out to be wrong.
double told_or(double told_sigma, bool is_refined, double usual_sigma) {
  return told_sigma > 0 ? told_sigma : (is_refined ? usual_sigma : 0.0);
}

}  // namespace

void Suspects::begin(FilterState& state) {
  all_.clear();
  for (int c = 0; c < state.cameras(); ++c) {
    add_lens(c);
    if (rules_.doubts && cameras_[static_cast<std::size_t>(c)].readout_sigma_s == 0 &&
        !state.clocks[static_cast<std::size_t>(c)].rows_apart)
      all_.push_back({Kind::kReadout, c, -1, layout::readout(c), kTightReadout_s, kOpenReadout_s,
                      kSettledReadout_s});
  }
  add_sizes(state.cameras());
  for (const Suspect& suspect : all_)
    state.clear_column(suspect.column,
                       suspect.is_parameter ? suspect.open_sigma : suspect.tight_sigma);
  for (int k = 0; rules_.doubts && k < layout::kWatchedPrints; ++k) {
    all_.push_back({Kind::kOnePrint, -1, k, layout::print(state.cameras(), k), kTightScale,
                    kOpenPrint, kSettledScale});
  }
  state.suspicions.assign(all_.size(), {});
  for (std::size_t i = 0; i < all_.size(); ++i) state.suspicions[i].is_open = all_[i].is_parameter;
}

void Suspects::assume(Suspect& suspect, double sigma) {
  suspect.assumed_sigma = sigma;
  suspect.tight_sigma = kHeldShare * sigma;
}

void Suspects::add_lens(int camera) {
  const CameraMount& mount = cameras_[static_cast<std::size_t>(camera)];
  const double focal = told_or(mount.focal_sigma, rules_.refines, kOpenFocal);
  const double centre = told_or(mount.centre_sigma_px, rules_.refines, kOpenCentre_px);
  const double k1 = told_or(mount.k1_sigma, rules_.refines, kOpenDistortion);
  const auto add = [&](Suspect suspect, double told_sigma, double assumed_sigma) {
    suspect.is_parameter = told_sigma > 0;
    if (suspect.is_parameter) suspect.open_sigma = told_sigma;
    const bool is_assumed = rules_.assumes && assumed_sigma > 0;
    if (!suspect.is_parameter && is_assumed) assume(suspect, assumed_sigma);
    if (suspect.is_parameter || rules_.doubts || is_assumed) all_.push_back(suspect);
  };
  add({Kind::kFocalLength, camera, -1, layout::focal(camera), kTightFocal, kOpenFocal,
       kSettledFocal},
      focal, kAssumedFocal);
  add({Kind::kCentreU, camera, -1, layout::centre(camera), kTightCentre_px, kOpenCentre_px,
       kSettledCentre_px},
      centre, kAssumedCentre_px);
  add({Kind::kCentreV, camera, -1, layout::centre(camera) + 1, kTightCentre_px, kOpenCentre_px,
       kSettledCentre_px},
      centre, kAssumedCentre_px);
  add({Kind::kDistortion, camera, -1, layout::distortion(camera), kTightDistortion, kOpenDistortion,
       kSettledDistortion},
      k1, 0);
}

void Suspects::add_sizes(int cameras) {
  if (!rules_.doubts && !rules_.assumes) return;
  all_.push_back(
      {Kind::kAllPrints, -1, -1, layout::sizes(cameras), kTightScale, kOpenCommon, kSettledScale});
  if (rules_.assumes) assume(all_.back(), kAssumedScale);
}

/// A free place, or that of the tag which is out of sight for longest and not suspected: whose
/// print is not watched while it is in sight, its error is taken for its neighbours'. -1: none.
int Suspects::room_for_print(const FilterState& state) const {
  int room = -1;
  Instant longest = state.time;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    const int print = all_[i].print;
    if (print < 0) continue;
    const int tag_id = state.sizes.watched[static_cast<std::size_t>(print)].tag_id;
    if (tag_id < 0) return print;
    if (state.suspicions[i].is_open || std::abs(score(state, all_[i])) > kSuspected_sigma) continue;
    const int tag = state.find(tag_id);
    if (tag < 0) continue;
    const Instant seen = state.tags[static_cast<std::size_t>(tag)].last_seen;
    if (seen >= longest) continue;
    longest = seen;
    room = print;
  }
  return room;
}

void Suspects::watch_print(FilterState& state, int tag_id) const {
  if (!state.has_suspects() || !rules_.doubts) return;
  const int room = room_for_print(state);
  if (room < 0) return;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    if (all_[i].print == room) state.suspicions[i] = {};
  }
  state.sizes.watched[static_cast<std::size_t>(room)] = {tag_id, 0.0};
  state.clear_column(layout::print(state.cameras(), room), kTightScale);
}

double Suspects::value(const FilterState& state, const Suspect& suspect) {
  const auto camera = static_cast<std::size_t>(std::max(0, suspect.camera));
  switch (suspect.kind) {
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
      return state.sizes.watched[static_cast<std::size_t>(suspect.print)].scale;
  }
}

double Suspects::score(const FilterState& state, const Suspect& suspect) {
  if (suspect.print >= 0 &&
      state.sizes.watched[static_cast<std::size_t>(suspect.print)].tag_id < 0) {
    return 0;
  }
  const double information = information_of(state, suspect.column, suspect.tight_sigma);
  // Less is rounding.
  if (information * suspect.tight_sigma * suspect.tight_sigma < 1e-6) return 0;
  return value(state, suspect) /
         (state.P()(suspect.column, suspect.column) * std::sqrt(information));
}

bool Suspects::look(FilterState& state, int camera, double dispersion) const {
  std::size_t worst = all_.size();
  double worst_score = 0;
  const double scale = std::sqrt(std::max(1.0, dispersion));
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& suspect = all_[i];
    Suspicion& suspicion = state.suspicions[i];
    if (suspect.is_parameter) continue;
    if (suspicion.is_open) {
      ++suspicion.images_open;
      const double sigma = std::sqrt(state.P()(suspect.column, suspect.column));
      if (suspicion.images_open > kLeastOpenImages && sigma < suspect.settled &&
          std::abs(value(state, suspect)) < kClosed_sigma * sigma) {
        close(state, camera, i);
      }
      continue;
    }
    const double beyond = std::abs(score(state, suspect)) / scale;
    suspicion.images_beyond = beyond > kOpen_sigma ? suspicion.images_beyond + 1 : 0;
    if (beyond > worst_score) {
      worst = i;
      worst_score = beyond;
    }
  }
  // Of what the most suspicious one did, others are accused, too, and sometimes sooner.
  const bool opens = worst < all_.size() && state.suspicions[worst].images_beyond >= kOpenImages &&
                     state.time >= state.judged_until;
  if (opens) open(state, camera, worst);
  release_cleared_prints(state);
  return opens;
}

/// A lens is guessed, or calibrated, as a whole: once one of its numbers is wrong the others are
/// not known either, and with them taken for exact that one would have to explain what is theirs.
bool Suspects::opens_with(const Suspect& suspect, const Suspect& other) {
  return &suspect == &other ||
         (is_of_lens(suspect.kind) && is_of_lens(other.kind) && suspect.camera == other.camera);
}

void Suspects::open(FilterState& state, int camera, std::size_t suspect) const {
  std::vector<std::size_t> opened;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    const Suspect& one = all_[i];
    if (state.suspicions[i].is_open || !opens_with(all_[suspect], one)) continue;
    exchange_prior(state, camera, one.column, value(state, one), one.tight_sigma, one.open_sigma);
    state.suspicions[i] = {.is_open = true};
    opened.push_back(i);
  }
  const std::vector<int> closed = closed_columns(state);
  for (const std::size_t i : opened) {
    widen(state, all_[i].column, kUnsureShare * std::abs(value(state, all_[i])), closed);
  }
  // What the others were accused of may have been this one's.
  for (Suspicion& other : state.suspicions) other.images_beyond = 0;
}

void Suspects::begin_open(FilterState& state, std::span<const WrongNumber> wrong) const {
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& one = all_[i];
    const auto is_this = [&](const WrongNumber& number) {
      return number.kind == one.kind && number.camera == one.camera;
    };
    if (one.is_parameter || std::none_of(wrong.begin(), wrong.end(), is_this)) continue;
    state.suspicions[i].is_open = true;
    state.clear_column(one.column, one.open_sigma);
  }
}

std::vector<WrongNumber> Suspects::found_wrong(const FilterState& state) const {
  std::vector<WrongNumber> out;
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& one = all_[i];
    if (state.suspicions[i].is_open && !one.is_parameter && one.camera >= 0)
      out.push_back({one.kind, one.camera});
  }
  return out;
}

std::vector<int> Suspects::closed_columns(const FilterState& state) const {
  std::vector<int> columns;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    if (!state.suspicions[i].is_open) columns.push_back(all_[i].column);
  }
  return columns;
}

void Suspects::close(FilterState& state, int camera, std::size_t suspect) const {
  const Suspect& one = all_[suspect];
  exchange_prior(state, camera, one.column, value(state, one), one.open_sigma, one.tight_sigma);
  state.suspicions[suspect] = {};
}

void Suspects::release_cleared_prints(FilterState& state) const {
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& suspect = all_[i];
    if (suspect.print < 0 || state.suspicions[i].is_open) continue;
    auto& watched = state.sizes.watched[static_cast<std::size_t>(suspect.print)];
    if (watched.tag_id < 0) continue;
    const double information = information_of(state, suspect.column, suspect.tight_sigma);
    if (information < 1 / (kCleared * kCleared) || std::abs(score(state, suspect)) > kCleared_sigma)
      continue;
    watched = {};
    state.clear_column(suspect.column, 0);
  }
}

bool Suspects::is_lens_open(const FilterState& state, int camera) const {
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& suspect = all_[i];
    if (!is_of_lens(suspect.kind) || suspect.camera != camera || !state.suspicions[i].is_open)
      continue;
    if (!suspect.is_parameter || suspect.open_sigma >= kClearedSettled * suspect.settled)
      return true;
  }
  return false;
}

bool Suspects::are_cleared(const FilterState& state, int camera) const {
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& suspect = all_[i];
    const bool is_another = suspect.camera >= 0 && suspect.camera != camera;
    if (suspect.print >= 0 || is_another) continue;
    const double least = kClearedSettled * suspect.settled;
    if (suspect.is_parameter && suspect.open_sigma < least) continue;  // calibrated
    if (state.suspicions[i].is_open) return false;
    const double information = information_of(state, suspect.column, suspect.tight_sigma);
    if (!(information * least * least > 1)) return false;
    if (std::abs(score(state, suspect)) > kSuspected_sigma) return false;
  }
  return state.has_suspects() && rules_.doubts;
}

Matrix6d Suspects::unstated(const FilterState& state) const {
  Matrix6d out = Matrix6d::Zero();
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    if (state.suspicions[i].is_open || !(std::abs(score(state, all_[i])) > kSuspected_sigma))
      continue;
    const Vector6d suspected = pull(state, all_[i]);
    out += suspected * suspected.transpose();
  }
  for (const Suspect& suspect : all_) {
    const double held = state.P()(suspect.column, suspect.column);
    if (suspect.assumed_sigma == 0 || !(held > 0)) continue;
    const double more = suspect.assumed_sigma * suspect.assumed_sigma - held;
    const Vector6d along = state.P().col(suspect.column).head<6>() / held;
    out += std::max(0.0, more) * along * along.transpose();
  }
  return out;
}

Vector6d Suspects::pull(const FilterState& state, const Suspect& suspect) {
  const auto p = state.P().col(suspect.column);
  const double gained = 1 / (suspect.open_sigma * suspect.open_sigma) -
                        1 / (suspect.tight_sigma * suspect.tight_sigma);
  const double S = 1 + gained * p(suspect.column);
  if (!(S > 1e-9)) return Vector6d::Zero();
  return -gained / S * value(state, suspect) * p.head<6>();
}

}  // namespace fiducap::world
