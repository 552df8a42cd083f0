#include "calibration/intrinsics/lens_uncertainty.hpp"

#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/initial_state.hpp"
#include "calibration/intrinsics/lens_fit.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMinPartViews = 5;

/// A part of the images with their poses.
template <typename Wanted>
LensFit part_of(const LensFit& fit, const Wanted& wanted) {
  LensFit part = fit;
  part.data.views.clear();
  part.state.X_VG.clear();
  std::size_t used = 0;
  for (std::size_t v = 0; v < fit.data.views.size(); ++v) {
    if (fit.data.views[v].sightings.empty() || !wanted(used++)) continue;
    part.data.views.push_back(fit.data.views[v]);
    part.state.X_VG.push_back(fit.state.X_VG[v]);
  }
  split_groups(part.data, part.state);
  return part;
}

double rms_of(const LensFit& fit) { return rms_per_coordinate(residuals(fit.data, fit.state)); }

/// Sums of squared residuals of the images of `others`, with the lens of `fitted` and with their
/// own.
struct Validation {
  double squares{};
  double own{};
};

std::optional<Validation> validate_with(const LensFit& fitted, const LensFit& others) {
  LensFit lens = fitted;
  if (!adjust(lens.data, {lens.free}, lens.state)) return std::nullopt;
  LensFit tested = others;
  if (!adjust(tested.data, {{}}, tested.state)) return std::nullopt;
  const auto points = static_cast<double>(count_points(tested.data));
  Validation out;
  out.own = points * std::pow(rms_of(tested), 2);
  tested.state.camera = lens.state.camera;
  if (!adjust(tested.data, {{}}, tested.state)) return std::nullopt;
  out.squares = points * std::pow(rms_of(tested), 2);
  return out;
}

/// Focal length and its sigma, px.
std::optional<std::pair<double, double>> focal_of(LensFit part) {
  if (part.data.views.size() < kMinPartViews) return std::nullopt;
  if (!adjust(part.data, {part.free}, part.state)) return std::nullopt;
  const auto uncertainty = uncertainty_of(part.data, part.state, part.free, part.sigma_px);
  if (!uncertainty.determined) return std::nullopt;
  return std::pair{part.state.camera.fu, std::sqrt(uncertainty.covariance(0, 0))};
}

}  // namespace

double HeldOut::focal_step_sigma() const {
  const double sigma = std::hypot(first_sigma, second_sigma);
  return sigma > 0 ? std::abs(second_focal - first_focal) / sigma : 0;
}

HeldOut hold_out(const LensFit& fit) {
  HeldOut out;
  const LensFit even = part_of(fit, [](std::size_t i) { return i % 2 == 0; });
  const LensFit odd = part_of(fit, [](std::size_t i) { return i % 2 == 1; });
  const std::size_t used = even.data.views.size() + odd.data.views.size();
  if (used < 2 * kMinPartViews) return out;
  const auto forth = validate_with(even, odd);
  const auto back = validate_with(odd, even);
  if (!forth || !back) return out;
  out.tried = true;
  const double own = forth->own + back->own;
  out.ratio = own > 0 ? std::sqrt((forth->squares + back->squares) / own) : 1;
  const auto first = focal_of(part_of(fit, [&](std::size_t i) { return 2 * i < used; }));
  const auto second = focal_of(part_of(fit, [&](std::size_t i) { return 2 * i >= used; }));
  if (!first || !second) return out;
  std::tie(out.first_focal, out.first_sigma) = *first;
  std::tie(out.second_focal, out.second_sigma) = *second;
  return out;
}

}  // namespace fiducap
