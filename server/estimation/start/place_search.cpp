#include "estimation/start/place_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/so3.hpp"
#include "detection/corner_projection.hpp"
#include "detection/tag_pose.hpp"

namespace fiducap {

namespace {

// One wrong tag must not outvote the others.
constexpr double kInlierSigmas = 5.0;
constexpr double kFirstInlierSigmas = 50.0;  // one tag's pose predicts the others badly
constexpr double kCostCapPerTag = 8 * kInlierSigmas * kInlierSigmas;
constexpr std::size_t kMaxProposers = 6;

double surprise_of(const Pose& X_AB, const PlaceGuess& guess) {
  const double cost =
      (X_AB.p - guess.X_AB.p).squaredNorm() / (guess.position_sigma_m * guess.position_sigma_m);
  const double turn = angle_between(X_AB.q, guess.X_AB.q) / guess.rotation_sigma_rad;
  return cost + turn * turn;
}

double cost_of(const Pose& X_AB, std::span<const SightedTag> tags, const PlaceGuess& guess,
               double noise_px) {
  double cost = surprise_of(X_AB, guess);
  for (const SightedTag& tag : tags) {
    const CornerResidual r = corner_residual(*tag.seen, (X_AB * tag.X_BV).inverse() * tag.X_AT,
                                             *tag.camera, 1.0, tag.k1);
    cost += r.in_front ? std::min(kCostCapPerTag, r.y.squaredNorm() / (noise_px * noise_px))
                       : kCostCapPerTag;
  }
  return cost;
}

/// Least squares over all tags, far ones first let in and then left out: ends close to where the
/// filter's own answer will be, so that the transition is linearised there and not at one tag's
/// noisy pose.
Pose refine(const Pose& X_AB, std::span<const SightedTag> tags, double noise_px) {
  const Pose near = resect(X_AB, tags, kFirstInlierSigmas * noise_px);
  return resect(near, tags, kInlierSigmas * noise_px);
}

double size_px(const TagObservation& tag) { return (tag.corners_px[0] - tag.corners_px[2]).norm(); }

}  // namespace

std::optional<PlaceFound> find_place(std::span<const SightedTag> tags, const PlaceGuess& guess,
                                     double corner_noise_px, double same_rad) {
  std::vector<const SightedTag*> proposers;
  for (const SightedTag& tag : tags) proposers.push_back(&tag);
  std::sort(proposers.begin(), proposers.end(),
            [](const auto* a, const auto* b) { return size_px(*a->seen) > size_px(*b->seen); });
  if (proposers.size() > kMaxProposers) proposers.resize(kMaxProposers);

  struct Proposal {
    Pose X_AB;
    double cost;
  };
  std::vector<Proposal> proposals;
  for (const SightedTag* tag : proposers) {
    for (const TagPose& pose : solve_tag_pose(*tag->seen, *tag->camera)) {
      if (!std::isfinite(pose.rms_px)) continue;
      const Pose X_AB =
          refine(tag->X_AT * (tag->X_BV * pose.X_VT).inverse(), tags, corner_noise_px);
      proposals.push_back({X_AB, cost_of(X_AB, tags, guess, corner_noise_px)});
    }
  }
  if (proposals.empty()) return std::nullopt;
  const auto best = std::min_element(proposals.begin(), proposals.end(),
                                     [](const auto& a, const auto& b) { return a.cost < b.cost; });
  const double numbers = 8.0 * static_cast<double>(tags.size()) - 6.0;
  PlaceFound found{best->X_AB, std::numeric_limits<double>::infinity(), best->cost / numbers,
                   surprise_of(best->X_AB, guess)};
  for (const Proposal& other : proposals) {
    if (angle_between(other.X_AB.q, best->X_AB.q) > same_rad) {
      found.evidence = std::min(found.evidence, other.cost - best->cost);
    }
  }
  return found;
}

}  // namespace fiducap
