#include "estimation/robocentric/relink.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/so3.hpp"
#include "detection/tag_pose.hpp"
#include "estimation/resection.hpp"

namespace fiducap::robocentric {

namespace {

// One wrong tag must not outvote the others.
constexpr double kInlierSigmas = 5.0;
constexpr double kFirstInlierSigmas = 50.0;  // one tag's pose predicts the others badly
constexpr double kCostCapPerTag = 8 * kInlierSigmas * kInlierSigmas;
constexpr std::size_t kMaxProposers = 6;
// Motions closer than this are the same answer.
constexpr double kSameAngle_rad = 0.05;

Pose tag_in_start_body(const FilterState& state, const TagToUse& tag) {
  if (tag.local >= 0) return state.X_BV[0] * state.tags[static_cast<std::size_t>(tag.local)].X_VT;
  return state.X_WB().inverse() * tag.known->X_WT;
}

double cost_of(const Pose& X_B0B, const FilterState& state, int camera, const CameraModel& model,
               std::span<const TagToUse> tags, const StepGuess& guess, double noise_px) {
  const Pose X_VB0 = (X_B0B * state.X_BV[static_cast<std::size_t>(camera)]).inverse();
  double cost = (X_B0B.p - guess.X_B0B.p).squaredNorm() / (guess.position_sigma_m * guess.position_sigma_m);
  const double turn = angle_between(X_B0B.q, guess.X_B0B.q) / guess.rotation_sigma_rad;
  cost += turn * turn;
  for (const TagToUse& tag : tags) {
    const CornerResidual r = corner_residual(*tag.seen, X_VB0 * tag_in_start_body(state, tag), model);
    cost += r.in_front ? std::min(kCostCapPerTag, r.y.squaredNorm() / (noise_px * noise_px)) : kCostCapPerTag;
  }
  return cost;
}

/// Least squares over all tags, far ones first let in and then left out: ends close to where the filter's own answer will be, so that the transition is
/// linearised there and not at one tag's noisy pose.
Pose refine(const Pose& X_B0B, const FilterState& state, int camera, const CameraModel& model,
            std::span<const TagToUse> tags, double noise_px) {
  const Pose& X_BV = state.X_BV[static_cast<std::size_t>(camera)];
  std::vector<SightedTag> sighted;
  for (const TagToUse& tag : tags) sighted.push_back({tag.seen, &model, X_BV, tag_in_start_body(state, tag)});
  const Pose near = resect(X_B0B, sighted, kFirstInlierSigmas * noise_px);
  return resect(near, sighted, kInlierSigmas * noise_px);
}

double size_px(const TagObservation& tag) { return (tag.corners_px[0] - tag.corners_px[2]).norm(); }

}  // namespace

std::optional<StepFound> find_step(const FilterState& state, int camera, const CameraModel& model,
                                   std::span<const TagToUse> tags, const StepGuess& guess, double corner_noise_px) {
  std::vector<const TagToUse*> proposers;
  for (const TagToUse& tag : tags) proposers.push_back(&tag);
  std::sort(proposers.begin(), proposers.end(),
            [](const auto* a, const auto* b) { return size_px(*a->seen) > size_px(*b->seen); });
  if (proposers.size() > kMaxProposers) proposers.resize(kMaxProposers);

  struct Proposal {
    Pose X_B0B;
    double cost;
  };
  std::vector<Proposal> proposals;
  for (const TagToUse* tag : proposers) {
    for (const TagPose& pose : solve_tag_pose(*tag->seen, model)) {
      if (!std::isfinite(pose.rms_px)) continue;
      const Pose X_BT = state.X_BV[static_cast<std::size_t>(camera)] * pose.X_VT;
      const Pose proposed = tag_in_start_body(state, *tag) * X_BT.inverse();
      const Pose X_B0B = refine(proposed, state, camera, model, tags, corner_noise_px);
      proposals.push_back({X_B0B, cost_of(X_B0B, state, camera, model, tags, guess, corner_noise_px)});
    }
  }
  if (proposals.empty()) return std::nullopt;
  const auto best = std::min_element(proposals.begin(), proposals.end(),
                                     [](const auto& a, const auto& b) { return a.cost < b.cost; });
  StepFound found{best->X_B0B, std::numeric_limits<double>::infinity()};
  for (const Proposal& other : proposals) {
    if (angle_between(other.X_B0B.q, best->X_B0B.q) > kSameAngle_rad) {
      found.evidence = std::min(found.evidence, other.cost - best->cost);
    }
  }
  return found;
}

MotionSinceImage step_by_unknown_motion(FilterState& state, const Pose& X_B0B, bool has_imu) {
  using namespace layout;  // NOLINT: the block names are the subject of this function
  const Eigen::Matrix3d R_back = X_B0B.rotation().transpose();
  state.p_WB_B = R_back * (state.p_WB_B + X_B0B.p);
  state.q_WB = (state.q_WB * X_B0B.q).normalized();
  state.v_WB_B.setZero();
  MotionSinceImage motion;
  motion.X_B0B = X_B0B;
  motion.Phi.block<3, 3>(kPosition, kPosition) = R_back;
  motion.Phi.block<3, 3>(kAttitude, kAttitude) = R_back;
  motion.Phi.block<3, 3>(kVelocity, kVelocity).setZero();
  Eigen::Matrix<double, kMotionSize, 6> from_step = Eigen::Matrix<double, kMotionSize, 6>::Zero();
  from_step.block<3, 3>(kPosition, 0).setIdentity();
  from_step.block<3, 3>(kPosition, 3) = skew(state.p_WB_B);
  from_step.block<3, 3>(kAttitude, 3).setIdentity();
  from_step.block<6, 6>(kStepPosition, 0).setIdentity();
  Matrix6d S = Matrix6d::Zero();
  S.diagonal() << Eigen::Vector3d::Constant(kUnknownStep_m * kUnknownStep_m),
      Eigen::Vector3d::Constant(kUnknownTurn_rad * kUnknownTurn_rad);
  motion.Q = from_step * S * from_step.transpose();
  motion.Q.diagonal().segment<3>(kVelocity).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  if (!has_imu) {
    state.bias_w.setZero();
    motion.Phi.block<3, 3>(kBiasW, kBiasW).setZero();
    motion.Q.diagonal().segment<3>(kBiasW).setConstant(kStartRate_rad_s * kStartRate_rad_s);
  }
  return motion;
}

}  // namespace fiducap::robocentric
