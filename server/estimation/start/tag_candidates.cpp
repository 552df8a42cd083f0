#include "estimation/start/tag_candidates.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/pose.hpp"

namespace fiducap {

void AttitudeStart::add(const ImuSample& imu, const Eigen::Vector3d& bias_w,
                        const Eigen::Vector3d& bias_f) {
  double dt = 0;
  if (last_) {
    dt = to_seconds(imu.sampled_at - last_->sampled_at);
    q_LB_ = (q_LB_ * exp_so3((0.5 * (imu.w_WB_B + last_->w_WB_B) - bias_w) * dt)).normalized();
  }
  last_ = imu;
  ++samples_;
  // First the mean, then a low-pass filter.
  const double share = std::max(1.0 / samples_, dt / (kMemory_s + dt));
  f_L_ += share * (q_LB_ * (imu.f_B - bias_f) - f_L_);
}

Eigen::Quaterniond AttitudeStart::q_LB(Instant at, const Eigen::Vector3d& bias_w) const {
  if (!last_) return q_LB_;
  const double dt = to_seconds(at - last_->sampled_at);
  return q_LB_ * exp_so3((last_->w_WB_B - bias_w) * dt);
}

Eigen::Quaterniond AttitudeStart::q_WB(Instant at, const Eigen::Vector3d& bias_w) const {
  return rotation_between(f_L_, Eigen::Vector3d::UnitZ()) * q_LB(at, bias_w);
}

namespace {
constexpr int kFitSteps = 5;
// Attitudes closer than this are one branch: both fits ended in one minimum.
constexpr double kSameBranch_rad = 0.05;
// Errors of lens and print are constant while a tag does not move in the image: number of views
// that count at one place.
constexpr int kViewsOfPlace = 10;
constexpr double kMoved_px = 5.0;
// A good fit costs 1 per degree of freedom. Above this the views do not show one fixed tag.
constexpr double kHopelessCostPerNumber = 25.0;
// Without attitude: a branch that costs this factor of the other after these views is rejected.
// With fewer views of a small tag the wrong branch can fit better by chance (three: 1 in 100).
constexpr int kRatioViews = 8;
constexpr double kClearRatio = 9.0;
// Age of dropped views: a gyro with the bias of a start has drifted by then.
constexpr Duration kOldestView = std::chrono::seconds(5);

/// The attitude of the other branch: the normal mirrored at the line of sight. Exact for a tag that
/// is far away compared with its size.
Eigen::Quaterniond mirrored(const Eigen::Quaterniond& q_VT, const Eigen::Vector3d& p_VT) {
  const Eigen::Vector3d normal = q_VT * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d towards = -p_VT.normalized();
  const Eigen::Vector3d axis = normal.cross(towards);
  const double sine = axis.norm();
  if (sine < 1e-9) return q_VT;
  return exp_so3(2.0 * std::atan2(sine, normal.dot(towards)) * axis / sine) * q_VT;
}

/// Whitens by the corner noise plus the effect of the camera's attitude error.
void whiten(double turn_sigma_rad, double weight, CornerResidual& r) {
  const Eigen::Matrix<double, 8, 3> H_q = std::sqrt(weight) * turn_sigma_rad * r.H.rightCols<3>();
  const Eigen::LLT<Matrix8d> noise(Matrix8d::Identity() + H_q * H_q.transpose());
  noise.matrixL().solveInPlace(r.y);
  noise.matrixL().solveInPlace(r.H);
}
}  // namespace

void TagCandidates::forget(int tag_id) {
  std::erase_if(candidates_, [&](const auto& entry) { return entry.first.first == tag_id; });
}

std::optional<TagVerdict> TagCandidates::judge(int camera, Instant at, const TagObservation& seen,
                                               const CameraModel& model, double noise_px,
                                               const std::optional<CameraAttitude>& attitude,
                                               const ViewLimits& limits) {
  const auto poses = solve_tag_pose(seen, model);
  if (!std::isfinite(poses[0].rms_px)) return std::nullopt;
  const auto is_aged = [&](Instant then) { return at - then > kOldestView; };
  for (auto& [key, candidate] : candidates_)
    std::erase_if(candidate.views, [&](const View& view) { return is_aged(view.at); });
  std::erase_if(candidates_, [&](const auto& entry) { return is_aged(entry.second.last_seen); });
  Candidate& candidate = candidates_[{seen.tag_id, camera}];
  candidate.last_seen = at;
  ++candidate.seen_times;
  const bool forced = limits.forced_after > 0 && candidate.seen_times >= limits.forced_after;
  const double noise = std::max(noise_px, config_.corner_noise_px);
  const double weight = 1.0 / (noise * noise);
  const auto decided =
      attitude ? judge_turning(
                     candidate,
                     {at, seen, weight, attitude->q_WV, attitude->turn_sigma_rad, poses[0].X_VT.p},
                     model, poses, forced)
               : judge_alone(candidate, {at, seen, weight, {}, 0, {}}, poses, forced);
  if (!decided || candidate.seen_times < limits.at_least) return std::nullopt;
  forget(seen.tag_id);
  return decided;
}

std::optional<TagVerdict> TagCandidates::judge_turning(Candidate& candidate, View newest,
                                                       const CameraModel& model,
                                                       const std::array<TagPose, 2>& poses,
                                                       bool forced) {
  const Eigen::Quaterniond q_WV = newest.q_WV;
  auto& views = candidate.views;
  if (views.size() >= static_cast<std::size_t>(config_.branch_views)) views.erase(views.begin());
  views.push_back(std::move(newest));
  Branch best = fit(views, model, q_WV * poses[0].X_VT.q, true);
  const auto mirror = [&] {
    return q_WV * mirrored(q_WV.conjugate() * best.q_WT, poses[0].X_VT.p);
  };
  Branch rival = fit(views, model, mirror(), true);
  if (rival.cost < best.cost) std::swap(best, rival);
  // Seen almost from the front both branches share one flat minimum: then the mirrored attitude
  // itself is the rival.
  if (angle_between(best.q_WT, rival.q_WT) < kSameBranch_rad)
    rival = fit(views, model, mirror(), false);

  const double numbers = 8.0 * static_cast<double>(views.size());
  if (best.cost > kHopelessCostPerNumber * numbers) {
    const Instant last_seen = candidate.last_seen;
    candidate = Candidate{};
    candidate.last_seen = last_seen;
    return std::nullopt;
  }
  const bool one_branch = angle_between(best.q_WT, rival.q_WT) < kSameBranch_rad;
  if (!one_branch && !forced && rival.cost - best.cost < config_.branch_evidence)
    return std::nullopt;
  // The pose is that of the newest image; the views selected its branch.
  const Eigen::Quaterniond q_VT = q_WV.conjugate() * best.q_WT;
  const bool first = angle_between(poses[0].X_VT.q, q_VT) <= angle_between(poses[1].X_VT.q, q_VT);
  return TagVerdict{poses[first ? 0 : 1].X_VT, best.q_WT, best.cost,
                    5 * static_cast<int>(views.size()) - 3};
}

TagCandidates::Branch TagCandidates::fit(std::vector<View>& views, const CameraModel& model,
                                         Eigen::Quaterniond q_WT, bool turns) const {
  double cost = 0;
  for (int step = 0; step < kFitSteps; ++step) {
    // Normal equations of the common attitude, positions eliminated (Schur complement).
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    cost = 0;
    for (View& view : views) {
      const Pose X_VT{view.q_WV.conjugate() * q_WT, view.p_VT};
      CornerResidual r = corner_residual(view.seen, X_VT, model);
      if (!r.in_front) return {q_WT, std::numeric_limits<double>::infinity()};
      if (view.turn_sigma_rad > 0) whiten(view.turn_sigma_rad, view.weight, r);
      const auto H_p = r.H.leftCols<3>();
      const Eigen::Matrix<double, 8, 3> H_q =
          r.H.rightCols<3>() * view.q_WV.conjugate().toRotationMatrix();
      const Eigen::LDLT<Eigen::Matrix3d> pp((H_p.transpose() * H_p).eval());
      const Eigen::Matrix3d pq = H_p.transpose() * H_q;
      const Eigen::Vector3d own = pp.solve(H_p.transpose() * r.y);
      A += view.weight * (H_q.transpose() * H_q - pq.transpose() * pp.solve(pq));
      b += view.weight * (H_q.transpose() * r.y - pq.transpose() * own);
      cost += view.weight * (r.y - H_p * own).squaredNorm();
      view.p_VT += own;
    }
    if (!turns) continue;
    A.diagonal().array() += 1e-9 * A.trace() + 1e-12;
    Eigen::Vector3d d = A.ldlt().solve(b);
    const double size = d.norm();
    if (size > 0.3) d *= 0.3 / size;  // stays near the minimum
    q_WT = (exp_so3(d) * q_WT).normalized();
  }
  return {q_WT, cost};
}

std::optional<TagVerdict> TagCandidates::judge_alone(Candidate& candidate, const View& newest,
                                                     const std::array<TagPose, 2>& poses,
                                                     bool forced) {
  // Tracks the branch that rotated least since the last view; first the better one.
  bool follows_better = true;
  if (candidate.seen_times > 1)
    follows_better = angle_between(poses[0].X_VT.q, candidate.followed_q_VT) <=
                     angle_between(poses[1].X_VT.q, candidate.followed_q_VT);
  const TagPose& followed = poses[follows_better ? 0 : 1];
  const TagPose& rival = poses[follows_better ? 1 : 0];
  candidate.followed_q_VT = followed.X_VT.q;
  const auto& px = newest.seen.corners_px;
  const Eigen::Vector2d middle_px = 0.25 * (px[0] + px[1] + px[2] + px[3]);
  if (candidate.seen_times == 1 || (middle_px - candidate.counted_px).norm() > kMoved_px) {
    candidate.counted_px = middle_px;
    candidate.counted_there = 0;
  }
  if (candidate.counted_there++ < kViewsOfPlace) {
    const double weight = 4 * newest.weight;  // rms over four corners
    candidate.followed_cost += weight * followed.rms_px * followed.rms_px;
    candidate.rival_cost += weight * rival.rms_px * rival.rms_px;
  }
  const double evidence = std::abs(candidate.rival_cost - candidate.followed_cost);
  const auto [small, large] = std::minmax(candidate.followed_cost, candidate.rival_cost);
  // With corners much sharper than configured the ratio of the costs decides before the difference.
  const bool clear_ratio = candidate.seen_times >= kRatioViews && large > kClearRatio * small;
  if (!forced && !clear_ratio && !(evidence >= config_.branch_evidence)) return std::nullopt;
  return TagVerdict{candidate.followed_cost <= candidate.rival_cost ? followed.X_VT : rival.X_VT,
                    std::nullopt};
}

}  // namespace fiducap
