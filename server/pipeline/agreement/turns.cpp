#include "pipeline/agreement/turns.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

// Sum of squares by which the other planar pose must be worse, in units of the corners' variance.
constexpr double kDecisive = 20;
// Two tags whose turns differ by more of their joint sigma contradict each other.
constexpr double kSameBySigmas = 4;
// A tag with a worse attitude is not used.
constexpr double kWorstSigma_rad = 0.08;
// Beyond, the first order does not hold, and images are blurred.
constexpr double kLargestTurn_rad = 1.0;
constexpr double kSmallestSide_px = 12;

double side_px(const TagObservation& tag) {
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i)
    sum += (tag.corners_px[i] - tag.corners_px[(i + 1) % 4]).norm();
  return sum / 4;
}

double noise_px(const TagObservation& tag, double otherwise_px) {
  return tag.corner_sigma_px > 0 ? tag.corner_sigma_px : otherwise_px;
}

/// Information of the attitude (rotation vector in V axes) when the position is unknown.
Eigen::Matrix3d attitude_information(const TagObservation& tag, const Pose& X_VT,
                                     const CameraModel& camera, double sigma_px) {
  const CornerResidual residual = corner_residual(tag, X_VT, camera);
  if (!residual.in_front) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix<double, 6, 6> all = residual.H.transpose() * residual.H;
  const Eigen::Matrix3d pp = all.topLeftCorner<3, 3>();
  const Eigen::Matrix3d pr = all.topRightCorner<3, 3>();
  const Eigen::Matrix3d rest = all.bottomRightCorner<3, 3>() - pr.transpose() * pp.ldlt().solve(pr);
  return rest / (sigma_px * sigma_px);
}

struct TagTurn {
  Eigen::Vector3d turn_V;
  Eigen::Matrix3d covariance;
};

/// The turn V1 ← V2 by a tag's attitudes in both.
Eigen::Vector3d turn_of(const TagPose& before, const TagPose& after) {
  return log_so3((before.X_VT.q * after.X_VT.q.conjugate()).normalized());
}

bool is_decided(const std::array<TagPose, 2>& poses, double sigma_px) {
  const double worse = poses[1].rms_px * poses[1].rms_px - poses[0].rms_px * poses[0].rms_px;
  return !std::isfinite(worse) || 4 * worse > kDecisive * sigma_px * sigma_px;
}

/// Which of both planar poses is right shows in one of the images, or in none. For a camera that
/// only rotates, both turn equally; then the mean is used, with half of the difference as its
/// error.
std::optional<TagTurn> turn_of_tag(const TagObservation& before, const TagObservation& after,
                                   const CameraModel& camera, double corner_noise_px) {
  const double sigma_before_px = noise_px(before, corner_noise_px);
  const double sigma_after_px = noise_px(after, corner_noise_px);
  const auto a = solve_tag_pose(before, camera);
  const auto b = solve_tag_pose(after, camera);
  if (!std::isfinite(a[0].rms_px) || !std::isfinite(b[0].rms_px)) return {};
  const bool a_is_decided = is_decided(a, sigma_before_px);
  const bool b_is_decided = is_decided(b, sigma_after_px);
  // A pose does not jump to the other one from one image to the next.
  const bool crossed = turn_of(a[0], b[1]).norm() + turn_of(a[1], b[0]).norm() <
                       turn_of(a[0], b[0]).norm() + turn_of(a[1], b[1]).norm();
  const std::size_t first = b_is_decided && !a_is_decided && crossed ? 1 : 0;
  const std::size_t of_first = !b_is_decided && crossed ? 1 : 0;
  TagTurn turn{turn_of(a[first], b[of_first]), Eigen::Matrix3d::Zero()};
  turn.covariance = attitude_information(before, a[first].X_VT, camera, sigma_before_px).inverse() +
                    attitude_information(after, b[of_first].X_VT, camera, sigma_after_px).inverse();
  if (!a_is_decided && !b_is_decided) {
    const Eigen::Vector3d half = 0.5 * (turn_of(a[1], b[1 - of_first]) - turn.turn_V);
    turn.turn_V += half;
    turn.covariance += half * half.transpose();
  }
  const bool is_good = turn.covariance.allFinite() &&
                       turn.covariance.trace() < 3 * kWorstSigma_rad * kWorstSigma_rad &&
                       turn.turn_V.norm() < kLargestTurn_rad;
  return is_good ? std::optional(turn) : std::nullopt;
}

CameraTurn as_camera_turn(const Eigen::Vector3d& turn_V, const Eigen::Matrix3d& covariance) {
  return {turn_V, std::sqrt(covariance.trace() / 3)};
}

// A longer gap may hide a turn to and fro.
constexpr Duration kLongestStep = std::chrono::milliseconds(60);
// Further back: not out of order, but another clock.
constexpr Duration kOtherClock = std::chrono::seconds(1);
constexpr double kClipped = 0.98;

std::int64_t step_at_or_after(Instant t, Duration step) {
  const std::int64_t ns = to_ns(t);
  return ns / step.count() + (ns % step.count() > 0 ? 1 : 0);
}

}  // namespace

void LargestTags::take(const TagObservations& seen) {
  at = seen.exposed_at - seen.clock_shift;
  count = 0;
  std::array<double, kTags> sides_px{};
  for (const TagObservation& tag : seen.tags) {
    const double side = side_px(tag);
    if (side < kSmallestSide_px) continue;
    std::size_t place = count;
    for (; place > 0 && sides_px[place - 1] < side; --place) {
      if (place == kTags) continue;
      tags[place] = tags[place - 1];
      sides_px[place] = sides_px[place - 1];
    }
    if (place == kTags) continue;
    tags[place] = tag;
    sides_px[place] = side;
    count = std::min(count + 1, kTags);
  }
}

std::optional<CameraTurn> turn_between(const LargestTags& before, const LargestTags& after,
                                       const CameraModel& camera, double corner_noise_px) {
  std::optional<TagTurn> first;
  for (std::size_t i = 0; i < after.count; ++i) {
    const TagObservation& tag = after.tags[i];
    const auto end = before.tags.begin() + static_cast<std::ptrdiff_t>(before.count);
    const auto same = std::find_if(before.tags.begin(), end, [&](const TagObservation& other) {
      return other.tag_id == tag.tag_id;
    });
    if (same == end) continue;
    const auto turn = turn_of_tag(*same, tag, camera, corner_noise_px);
    if (!turn) continue;
    if (!first) {
      first = turn;
      continue;
    }
    const Eigen::Matrix3d both = first->covariance + turn->covariance;
    const Eigen::Vector3d apart = turn->turn_V - first->turn_V;
    const Eigen::Vector3d weighted = both.ldlt().solve(apart);
    if (apart.dot(weighted) > kSameBySigmas * kSameBySigmas) return {};
    return as_camera_turn(
        first->turn_V + first->covariance * weighted,
        first->covariance - first->covariance * both.inverse() * first->covariance);
  }
  if (!first) return {};
  return as_camera_turn(first->turn_V, first->covariance);
}

void GyroIntegral::add(const ImuSample& imu) {
  if (!imu.w_WB_B.allFinite()) return;
  const bool is_clipped =
      range_rad_s_ > 0 && imu.w_WB_B.cwiseAbs().maxCoeff() > kClipped * range_rad_s_;
  if (is_clipped) {
    last_.reset();
    begin_ = end_ = 0;
    return;
  }
  const std::optional<ImuSample> before = std::exchange(last_, imu);
  const bool is_back = before && imu.sampled_at <= before->sampled_at;
  if (is_back && before->sampled_at - imu.sampled_at < kOtherClock) {
    last_ = before;  // the merger drops such a reading, too
    return;
  }
  if (!before || is_back || imu.sampled_at - before->sampled_at > kLongestStep) {
    begin_ = end_ = step_at_or_after(imu.sampled_at, kStep);
    last_sum_.setZero();
    return;
  }
  const double span_s = to_seconds(imu.sampled_at - before->sampled_at);
  const Eigen::Vector3d turn = 0.5 * span_s * (before->w_WB_B + imu.w_WB_B);
  for (; Instant{end_ * kStep} <= imu.sampled_at; ++end_) {
    const double share = to_seconds(Instant{end_ * kStep} - before->sampled_at) / span_s;
    sums_[place(end_)] = last_sum_ + share * turn;
  }
  last_sum_ += turn;
  begin_ = std::max(begin_, end_ - kSteps);
}

std::optional<Eigen::Vector3d> GyroIntegral::turn(Instant from, Instant to) const {
  if (!covers(from, to)) return std::nullopt;
  return at(to) - at(from);
}

/// @pre known
Eigen::Vector3d GyroIntegral::at(Instant t) const {
  const std::int64_t after = std::clamp(step_at_or_after(t, kStep), begin_, end_ - 1);
  const double behind = to_seconds(Instant{after * kStep} - t) / to_seconds(kStep);
  if (behind <= 0 || after == begin_) return sums_[place(after)];
  return sums_[place(after)] + behind * (sums_[place(after - 1)] - sums_[place(after)]);
}

}  // namespace fiducap
