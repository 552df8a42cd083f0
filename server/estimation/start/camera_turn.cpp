#include "estimation/start/camera_turn.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

// px: of a smaller tag the attitude is worse than kWorst_rad.
constexpr double kSmallestSide_px = 12;
// Factor of the corners' sigma for the choice of the planar pose: lens errors favour one of both.
constexpr double kLensFactor = 2;
// Two tags whose rotations differ by more of their joint sigma: one was moved.
constexpr double kMoved_sigma = 4;
// rad: 1-sigma per axis above which a rotation says nothing (a turn is about 0.2 rad).
constexpr double kWorst_rad = 0.1;
// rad: within the images' distance larger rotations blur them and exceed the second order.
constexpr double kLargest_rad = 1.0;

// A longer gap may hide a rotation to and fro.
constexpr Duration kLongestStep = std::chrono::milliseconds(60);
// Further back: not out of order, but another clock.
constexpr Duration kOtherClock = std::chrono::seconds(1);
// Relative distance to the end of the range within which a rate is saturated. A rate far beyond the
// range has another unit.
constexpr double kSaturated = 0.02;

double side_px(const TagObservation& tag) {
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i)
    sum += (tag.corners_px[i] - tag.corners_px[(i + 1) % 4]).norm();
  return sum / 4;
}

/// Covariance of the attitude (rotation vector in V axes) when the position is unknown.
Eigen::Matrix3d attitude_covariance(const TagObservation& tag, const Pose& X_VT,
                                    const CameraModel& camera, double sigma_px) {
  const CornerResidual residual = corner_residual(tag, X_VT, camera);
  const Eigen::Matrix<double, 6, 6> all = residual.H.transpose() * residual.H;
  const Eigen::Matrix3d pp = all.topLeftCorner<3, 3>();
  const Eigen::Matrix3d pr = all.topRightCorner<3, 3>();
  const Eigen::Matrix3d rest = all.bottomRightCorner<3, 3>() - pr.transpose() * pp.ldlt().solve(pr);
  return sigma_px * sigma_px * rest.inverse();
}

/// One of both planar poses of a tag in each of two images.
CameraTurn turn_of(const ImageAttitudes::Tag& a, std::size_t i, const ImageAttitudes::Tag& b,
                   std::size_t j) {
  return {log_so3((a.q_VT[i] * b.q_VT[j].conjugate()).normalized()),
          a.covariance[i] + b.covariance[j]};
}

/// A pose does not change to the other one between two images, so that two assignments are left,
/// of which the smaller rotations are right. A camera that only rotates has the same by both.
std::optional<CameraTurn> turn_by_tag(const ImageAttitudes::Tag& a, const ImageAttitudes::Tag& b) {
  const auto norms = [&](std::size_t j) {
    return turn_of(a, 0, b, j).turn_V.norm() + turn_of(a, 1, b, 1 - j).turn_V.norm();
  };
  const std::size_t j = norms(1) < norms(0) ? 1 : 0;
  const double excess = a.cost[1] + b.cost[1 - j] - a.cost[0] - b.cost[j];
  const double other = 1 / (1 + std::exp(excess / (2 * kLensFactor * kLensFactor)));
  CameraTurn turn = turn_of(a, 0, b, j);
  if (other > 0 && std::isfinite(excess)) {
    const CameraTurn second = turn_of(a, 1, b, 1 - j);
    const Eigen::Vector3d apart = second.turn_V - turn.turn_V;
    turn.turn_V += other * apart;
    turn.covariance = (1 - other) * turn.covariance + other * second.covariance +
                      other * (1 - other) * apart * apart.transpose();
  }
  const bool is_good = turn.covariance.allFinite() && turn.turn_V.norm() < kLargest_rad;
  return is_good ? std::optional(turn) : std::nullopt;
}

std::int64_t step_at_or_after(Instant t, Duration step) {
  const std::int64_t ns = to_ns(t);
  return ns / step.count() + (ns % step.count() > 0 ? 1 : 0);
}

}  // namespace

void ImageAttitudes::take(const TagObservations& image) {
  at = image.exposed_at - image.clock_shift;
  is_solved = false;
  std::array<std::pair<double, const TagObservation*>, kTags> largest;
  count = 0;
  for (const TagObservation& tag : image.tags) {
    std::pair<double, const TagObservation*> one{side_px(tag), &tag};
    if (one.first < kSmallestSide_px) continue;
    for (std::size_t i = 0; i < count; ++i)
      if (largest[i].first < one.first) std::swap(largest[i], one);
    if (count < kTags) largest[count++] = one;
  }
  for (std::size_t i = 0; i < count; ++i) seen[i] = *largest[i].second;
}

void ImageAttitudes::solve(const CameraModel& camera, double corner_noise_px) {
  if (std::exchange(is_solved, true)) return;
  const std::size_t found = std::exchange(count, 0);
  for (std::size_t i = 0; i < found; ++i) {
    const double sigma_px = seen[i].corner_sigma_px > 0 ? seen[i].corner_sigma_px : corner_noise_px;
    const auto poses = solve_tag_pose(seen[i], camera);
    if (!std::isfinite(poses[0].rms_px)) continue;
    Tag& tag = tags[count++];
    tag.tag_id = seen[i].tag_id;
    for (std::size_t k = 0; k < 2; ++k) {
      const double relative = poses[k].rms_px / sigma_px;
      tag.q_VT[k] = poses[k].X_VT.q;
      tag.covariance[k] = attitude_covariance(seen[i], poses[k].X_VT, camera, sigma_px);
      tag.cost[k] = 4 * relative * relative;
    }
  }
}

std::optional<CameraTurn> turn_between(const ImageAttitudes& before, const ImageAttitudes& after) {
  std::optional<CameraTurn> all;
  for (std::size_t i = 0; i < after.count; ++i) {
    for (std::size_t k = 0; k < before.count; ++k) {
      if (before.tags[k].tag_id != after.tags[i].tag_id) continue;
      const auto turn = turn_by_tag(before.tags[k], after.tags[i]);
      if (!turn) continue;
      if (!all) {
        all = turn;
        continue;
      }
      const Eigen::Matrix3d both = (all->covariance + turn->covariance).inverse();
      const Eigen::Vector3d apart = turn->turn_V - all->turn_V;
      if (apart.dot(both * apart) > kMoved_sigma * kMoved_sigma) return {};
      const Eigen::Matrix3d gain = all->covariance * both;
      all->turn_V += gain * apart;
      all->covariance -= (gain * all->covariance).eval();
    }
  }
  if (all && all->covariance.trace() > 3 * kWorst_rad * kWorst_rad) return {};
  return all;
}

void GyroIntegral::add(const ImuSample& imu) {
  if (!imu.w_WB_B.allFinite()) return;
  const double largest = imu.w_WB_B.cwiseAbs().maxCoeff();
  if (range_rad_s_ > 0 && std::abs(largest / range_rad_s_ - 1) < kSaturated) {
    last_.reset();
    begin_ = end_ = 0;
    return;
  }
  const std::optional<ImuSample> before = std::exchange(last_, imu);
  const bool is_back = before && imu.sampled_at <= before->sampled_at;
  if (is_back && before->sampled_at - imu.sampled_at < kOtherClock) {
    last_ = before;  // the merger drops such a sample, too
    return;
  }
  if (!before || is_back || imu.sampled_at - before->sampled_at > kLongestStep) {
    begin_ = end_ = step_at_or_after(imu.sampled_at, kStep);
    last_sums_ = {};
    return;
  }
  const double span_s = to_seconds(imu.sampled_at - before->sampled_at);
  const Eigen::Vector3d turn = 0.5 * span_s * (before->w_WB_B + imu.w_WB_B);
  const Eigen::Vector3d area = 0.5 * last_sums_.S.cross(turn);
  for (; Instant{end_ * kStep} <= imu.sampled_at; ++end_) {
    const double share = to_seconds(Instant{end_ * kStep} - before->sampled_at) / span_s;
    sums_[static_cast<std::size_t>(end_ & (kSteps - 1))] = {last_sums_.S + share * turn,
                                                            last_sums_.K + share * area};
  }
  last_sums_.S += turn;
  last_sums_.K += area;
  begin_ = std::max(begin_, end_ - kSteps);
}

Eigen::Vector3d GyroIntegral::turn(Instant from, Instant to, double unit) const {
  const Sums a = at(from);
  const Sums b = at(to);
  const Eigen::Vector3d S = b.S - a.S;
  return unit * S + unit * unit * (b.K - a.K - 0.5 * a.S.cross(S));
}

GyroIntegral::Sums GyroIntegral::at(Instant t) const {
  const std::int64_t after = std::clamp(step_at_or_after(t, kStep), begin_, end_ - 1);
  const double behind = to_seconds(Instant{after * kStep} - t) / to_seconds(kStep);
  const Sums& next = step(after);
  if (behind <= 0 || after == begin_) return next;
  const Sums& last = step(after - 1);
  return {next.S + behind * (last.S - next.S), next.K + behind * (last.K - next.K)};
}

}  // namespace fiducap
