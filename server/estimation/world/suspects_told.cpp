// What is told of the numbers that may be wrong.
#include <algorithm>
#include <cmath>

#include "capture/lens/calibrated_mount.hpp"
#include "estimation/world/suspects.hpp"

namespace fiducap::world {

namespace {

using Kind = FoundMismatch::Kind;

// What is told is known to this many sigmas.
constexpr double kTold_sigma = 4.0;
// A refined lens is told once it is known like this.
constexpr double kRefinedFocal = 5e-3;
constexpr double kRefinedCentre_px = 5.0;
constexpr double kRefinedDistortion = 0.02;  // of one of which nothing else is refined

// Corners are that far from the middle, in image widths.
constexpr double kTypicalRadius = 0.25;

}  // namespace

void Suspects::list(const FilterState& state, std::vector<FoundMismatch>& out) const {
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& suspect = all_[i];
    if (!state.suspicions[i].is_open || suspect.is_parameter) continue;
    const double sigma = std::sqrt(state.P()(suspect.column, suspect.column));
    const double found = value(state, suspect);
    // What is settled as being as configured is not told as being otherwise.
    if (!(std::abs(found) > std::max(kTold_sigma * sigma, suspect.settled))) continue;
    const int tag_id = suspect.print < 0
                           ? -1
                           : state.sizes.watched[static_cast<std::size_t>(suspect.print)].tag_id;
    if (suspect.print >= 0 && tag_id < 0) continue;
    out.push_back({suspect.kind, suspect.camera, tag_id, found, sigma, {}});
  }
  for (int c = 0; c < state.cameras() && state.has_suspects(); ++c) list_lens(state, c, out);
}

void Suspects::list_lens(const FilterState& state, int camera,
                         std::vector<FoundMismatch>& out) const {
  const LensEstimate now = lens(state, camera);
  if (!is_refined(camera) || is_as_calibrated(state, camera) || now.focal_sigma > kRefinedFocal ||
      now.centre_sigma_px.maxCoeff() > kRefinedCentre_px)
    return;
  if (now.focal_sigma == 0 && now.k1_sigma > kRefinedDistortion) return;
  out.push_back({Kind::kLens, camera, -1, now.offset.focal, now.focal_sigma, now});
}

/// A calibration knows what it leaves open; within that there is nothing to tell.
bool Suspects::is_as_calibrated(const FilterState& state, int camera) const {
  if (!tells_a_calibration(cameras_[static_cast<std::size_t>(camera)])) return false;
  return std::all_of(all_.begin(), all_.end(), [&](const Suspect& suspect) {
    return !suspect.is_parameter || suspect.camera != camera ||
           std::abs(value(state, suspect)) < kTold_sigma * suspect.open_sigma;
  });
}

bool Suspects::is_refined(int camera) const {
  return std::any_of(all_.begin(), all_.end(), [&](const Suspect& suspect) {
    return suspect.is_parameter && suspect.camera == camera;
  });
}

LensEstimate Suspects::lens(const FilterState& state, int camera) const {
  LensEstimate out;
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& suspect = all_[i];
    if (suspect.camera != camera || !state.suspicions[i].is_open) continue;
    const double sigma = std::sqrt(state.P()(suspect.column, suspect.column));
    if (suspect.kind == Kind::kFocalLength) out.focal_sigma = sigma;
    if (suspect.kind == Kind::kCentreU) out.centre_sigma_px.x() = sigma;
    if (suspect.kind == Kind::kCentreV) out.centre_sigma_px.y() = sigma;
    if (suspect.kind == Kind::kDistortion) out.k1_sigma = sigma;
  }
  if (!out.is_estimated()) return out;
  out.offset = state.lenses[static_cast<std::size_t>(camera)];
  const CameraMount& mount = cameras_[static_cast<std::size_t>(camera)];
  if (mount.lens_error_px == 0) return out;
  // What no number of the lens follows pulls at those that there are, for as long as one looks.
  const double radius_px = kTypicalRadius * mount.model.width;
  const double radius = radius_px / mount.model.fu;
  const auto no_less = [&](double& sigma, double left) {
    if (sigma > 0) sigma = std::hypot(sigma, left);
  };
  no_less(out.focal_sigma, mount.lens_error_px / radius_px);
  // A shift of the centre is a turn of the camera, but for the second order.
  no_less(out.centre_sigma_px.x(), mount.lens_error_px / (radius * radius));
  no_less(out.centre_sigma_px.y(), mount.lens_error_px / (radius * radius));
  no_less(out.k1_sigma, mount.lens_error_px / (mount.model.fu * radius * radius * radius));
  return out;
}

}  // namespace fiducap::world
