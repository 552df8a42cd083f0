#include "pipeline/replay/placement_misfit.hpp"

#include <cmath>

#include "detection/corner_projection.hpp"

namespace fiducap {

namespace {

constexpr double kInlierSigmas = 5.0;
constexpr double kFirstInlierSigmas = 50.0;
// What a tag behind the camera counts: that of one a whole image away.
constexpr double kBehind_px = 1000.0;

double misfit(const SightedTag& tag, const Pose& X_AB, double noise_px) {
  const CornerResidual r =
      corner_residual(*tag.seen, (X_AB * tag.X_BV).inverse() * tag.X_AT, *tag.camera);
  const Vector8d y = r.in_front ? r.y : Vector8d::Constant(kBehind_px);
  return kSightingBend * std::log1p(y.squaredNorm() / (noise_px * noise_px * kSightingBend));
}

}  // namespace

double misfit(std::span<const SightedTag> tags, const Pose& X_AB, double noise_px) {
  double cost = 0;
  for (const SightedTag& tag : tags) cost += misfit(tag, X_AB, noise_px);
  return cost;
}

Pose improved(const Pose& X_AB, std::span<const SightedTag> tags, double noise_px) {
  const Pose near = resect(X_AB, tags, kFirstInlierSigmas * noise_px);
  return resect(near, tags, kInlierSigmas * noise_px);
}

}  // namespace fiducap
