#include "calibration/intrinsics/held_out.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/lens_covariance.hpp"
#include "calibration/intrinsics/target_layout.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kLeastViews = 5;

/// A share of the images with their places.
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

/// Noise of the images of `others` under the lens of `fitted`, squared and summed; and with their
/// own.
struct Judged {
  double squares{};
  double own{};
};

std::optional<Judged> judge_by(const LensFit& fitted, const LensFit& others) {
  LensFit lens = fitted;
  if (!adjust(lens.data, {lens.free}, lens.state)) return std::nullopt;
  LensFit judged = others;
  if (!adjust(judged.data, {{}}, judged.state)) return std::nullopt;
  const auto points = static_cast<double>(count_points(judged.data));
  Judged out;
  out.own = points * std::pow(rms_of(judged), 2);
  judged.state.camera = lens.state.camera;
  if (!adjust(judged.data, {{}}, judged.state)) return std::nullopt;
  out.squares = points * std::pow(rms_of(judged), 2);
  return out;
}

struct Focal {
  double px{};
  double sigma{};
};

std::optional<Focal> focal_of(LensFit part) {
  if (part.data.views.size() < kLeastViews) return std::nullopt;
  if (!adjust(part.data, {part.free}, part.state)) return std::nullopt;
  const auto sure = uncertainty_of(part.data, part.state, part.free, part.sigma_px);
  if (!sure.determined) return std::nullopt;
  return Focal{part.state.camera.fu, std::sqrt(sure.covariance(0, 0))};
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
  if (used < 2 * kLeastViews) return out;
  const auto forth = judge_by(even, odd);
  const auto back = judge_by(odd, even);
  if (!forth || !back) return out;
  out.tried = true;
  const double own = forth->own + back->own;
  out.ratio = own > 0 ? std::sqrt((forth->squares + back->squares) / own) : 1;
  const auto first = focal_of(part_of(fit, [&](std::size_t i) { return 2 * i < used; }));
  const auto second = focal_of(part_of(fit, [&](std::size_t i) { return 2 * i >= used; }));
  if (!first || !second) return out;
  out.first_focal = first->px;
  out.first_sigma = first->sigma;
  out.second_focal = second->px;
  out.second_sigma = second->sigma;
  return out;
}

}  // namespace fiducap
