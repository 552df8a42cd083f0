#include "estimation/start/place_search.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "detection/tag_geometry.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

namespace {
constexpr int kSteps = 6;
constexpr double kLargestStep = 1.0;
constexpr double kConverged = 1e-9;

// Bounds of residuals: one wrong tag must not dominate the others.
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

}  // namespace

bool fits(const SightedTag& tag, const Pose& X_AB, double corner_noise_px) {
  const CornerResidual r =
      corner_residual(*tag.seen, (X_AB * tag.X_BV).inverse() * tag.X_AT, *tag.camera, 1.0, tag.k1);
  return r.in_front && r.y.squaredNorm() <= kCostCapPerTag * corner_noise_px * corner_noise_px;
}

Pose resect(Pose X_AB, std::span<const SightedTag> tags, double inlier_px) {
  const double limit = 8 * inlier_px * inlier_px;
  for (int step = 0; step < kSteps; ++step) {
    Matrix6d A = Matrix6d::Zero();
    Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
    for (const SightedTag& tag : tags) {
      const Pose X_BT = X_AB.inverse() * tag.X_AT;
      const CornerResidual r =
          corner_residual(*tag.seen, tag.X_BV.inverse() * X_BT, *tag.camera, 1.0, tag.k1);
      if (!r.in_front || r.y.squaredNorm() > limit) continue;
      const Eigen::Matrix3d R_VB = tag.X_BV.rotation().transpose();
      const Eigen::Matrix<double, 8, 3> H_p = r.H.leftCols<3>() * R_VB;
      const Eigen::Matrix<double, 8, 3> H_q = r.H.rightCols<3>() * R_VB;
      Matrix86d H;
      H << -H_p, H_p * skew(X_BT.p) - H_q;
      A.noalias() += H.transpose() * H;
      b.noalias() += H.transpose() * r.y;
    }
    if (A.isZero(0)) return X_AB;
    const Eigen::Matrix<double, 6, 1> d = A.ldlt().solve(b);
    if (!d.allFinite() || d.norm() > kLargestStep) return X_AB;
    X_AB.p += X_AB.q * d.head<3>();
    X_AB.q = (X_AB.q * exp_so3(d.tail<3>())).normalized();
    if (d.norm() < kConverged) break;
  }
  return X_AB;
}

std::optional<PlaceFound> find_place(std::span<const SightedTag> tags, const PlaceGuess& guess,
                                     double corner_noise_px, double same_rad) {
  std::vector<const SightedTag*> proposers;
  for (const SightedTag& tag : tags) proposers.push_back(&tag);
  std::ranges::sort(proposers, std::greater{}, [](const SightedTag* tag) {
    return (tag->seen->corners_px[0] - tag->seen->corners_px[2]).norm();
  });
  if (proposers.size() > kMaxProposers) proposers.resize(kMaxProposers);

  struct Proposal {
    Pose X_AB;
    double cost;
  };
  std::vector<Proposal> proposals;
  for (const SightedTag* tag : proposers) {
    for (const TagPose& pose : solve_tag_pose(*tag->seen, *tag->camera)) {
      if (!std::isfinite(pose.rms_px)) continue;
      // Wide bounds, then narrow ones: a better linearisation point than one tag's noisy pose.
      const Pose near = resect(tag->X_AT * (tag->X_BV * pose.X_VT).inverse(), tags,
                               kFirstInlierSigmas * corner_noise_px);
      const Pose X_AB = resect(near, tags, kInlierSigmas * corner_noise_px);
      proposals.push_back({X_AB, cost_of(X_AB, tags, guess, corner_noise_px)});
    }
  }
  if (proposals.empty()) return std::nullopt;
  const auto best = std::ranges::min_element(proposals, {}, &Proposal::cost);
  const double numbers = 8.0 * static_cast<double>(tags.size()) - 6.0;
  PlaceFound found{best->X_AB, std::numeric_limits<double>::infinity(), best->cost / numbers,
                   surprise_of(best->X_AB, guess)};
  for (const Proposal& other : proposals) {
    if (angle_between(other.X_AB.q, best->X_AB.q) > same_rad)
      found.evidence = std::min(found.evidence, other.cost - best->cost);
  }
  return found;
}

}  // namespace fiducap
