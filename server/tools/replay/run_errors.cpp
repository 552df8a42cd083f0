#include "tools/replay/run_errors.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr Duration kMaxTruthGap = std::chrono::milliseconds(50);

/// Every estimate from `from` on that has a truth, both in axes A.
template <typename Take>
void for_each_pair(std::span<const StampedPose> estimates, std::span<const TruthSample> truth,
                   const Pose& estimated_X_WA, const Pose& true_X_WA, Instant from,
                   const Take& take) {
  const Pose estimated_X_AW = estimated_X_WA.inverse();
  const Pose true_X_AW = true_X_WA.inverse();
  for (const StampedPose& estimate : estimates) {
    if (estimate.at < from) continue;
    if (const auto true_X_WB = truth_at(truth, estimate.at))
      take(estimate.at, estimated_X_AW * estimate.X_WB, true_X_AW * *true_X_WB);
  }
}

/// Quantile of `count` values, of which those that are missing count as the largest.
/// @return nullopt when it falls on a missing one
std::optional<double> quantile_of_all(std::vector<double> values, std::size_t count, double share) {
  const double place = share * static_cast<double>(count) - share;
  if (!(place <= static_cast<double>(values.size()) - 1)) return std::nullopt;
  values.resize(count, *std::ranges::max_element(values));
  return quantile(std::move(values), share);
}

/// Takes the columns of `from` to those of `to`.
Pose rigid_fit(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to) {
  const Eigen::Matrix4d fit = Eigen::umeyama(from, to, false);
  return {Eigen::Quaterniond(Eigen::Matrix3d(fit.topLeftCorner<3, 3>())),
          fit.topRightCorner<3, 1>()};
}

}  // namespace

void ErrorSum::add(const Pose& estimated, const Pose& truth) {
  const double position = (estimated.p - truth.p).norm();
  const double rotation = angle_between(estimated.q, truth.q);
  ++errors_.samples;
  position_squares_ += position * position;
  rotation_squares_ += rotation * rotation;
  errors_.position_max_m = std::max(errors_.position_max_m, position);
  errors_.rotation_max_rad = std::max(errors_.rotation_max_rad, rotation);
}

PoseErrors ErrorSum::result() const {
  PoseErrors errors = errors_;
  if (errors.samples == 0) return errors;
  errors.position_rmse_m = std::sqrt(position_squares_ / errors.samples);
  errors.rotation_rmse_rad = std::sqrt(rotation_squares_ / errors.samples);
  return errors;
}

std::optional<Duration> median_step(std::span<const StampedPose> poses, std::size_t stride) {
  std::vector<Duration> steps;
  for (std::size_t i = stride; i < poses.size(); ++i)
    steps.push_back(poses[i].at - poses[i - stride].at);
  if (steps.empty()) return std::nullopt;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

std::string text_of(const PoseErrors& errors) {
  return fmt::format("{:.2f} mm, {:.3f}° RMSE; worst {:.2f} mm, {:.3f}°",
                     1000 * errors.position_rmse_m, kDegreesPerRadian * errors.rotation_rmse_rad,
                     1000 * errors.position_max_m, kDegreesPerRadian * errors.rotation_max_rad);
}

const TagPlace* find_tag(std::span<const TagPlace> tags, int tag_id) {
  const auto found = std::ranges::find(tags, tag_id, &TagPlace::tag_id);
  return found == tags.end() ? nullptr : &*found;
}

std::optional<Pose> truth_at(std::span<const TruthSample> truth, Instant at) {
  const auto after = std::ranges::lower_bound(truth, at, {}, &TruthSample::at);
  if (after == truth.end()) return std::nullopt;
  if (after->at == at) return after->X_WB;
  if (after == truth.begin()) return std::nullopt;
  const auto before = after - 1;
  const Duration gap = after->at - before->at;
  if (gap > kMaxTruthGap) return std::nullopt;
  const double s = to_seconds(at - before->at) / to_seconds(gap);
  return Pose{before->X_WB.q.slerp(s, after->X_WB.q), (1 - s) * before->X_WB.p + s * after->X_WB.p};
}

PoseErrors pose_errors(std::span<const StampedPose> estimates, std::span<const TruthSample> truth,
                       const Pose& estimated_X_WA, const Pose& true_X_WA, Instant from) {
  ErrorSum sum;
  for_each_pair(
      estimates, truth, estimated_X_WA, true_X_WA, from,
      [&](Instant, const Pose& estimate, const Pose& true_pose) { sum.add(estimate, true_pose); });
  return sum.result();
}

std::optional<Pose> fitted_axes(std::span<const StampedPose> estimates,
                                std::span<const TruthSample> truth, Instant from) {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> pairs;
  for_each_pair(estimates, truth, Pose{}, Pose{}, from,
                [&](Instant, const Pose& estimate, const Pose& true_pose) {
                  pairs.emplace_back(true_pose.p, estimate.p);
                });
  if (pairs.size() < 3) return std::nullopt;
  Eigen::Matrix3Xd theirs(3, pairs.size());
  Eigen::Matrix3Xd ours(3, pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    theirs.col(static_cast<Eigen::Index>(i)) = pairs[i].first;
    ours.col(static_cast<Eigen::Index>(i)) = pairs[i].second;
  }
  return rigid_fit(theirs, ours);
}

std::vector<PoseDifference> pose_differences(std::span<const StampedPose> estimates,
                                             std::span<const TruthSample> truth,
                                             const Pose& estimated_X_WA, const Pose& true_X_WA,
                                             Instant from) {
  std::vector<PoseDifference> differences;
  for_each_pair(estimates, truth, estimated_X_WA, true_X_WA, from,
                [&](Instant at, const Pose& estimate, const Pose& true_pose) {
                  differences.push_back({at, estimate.p - true_pose.p,
                                         log_so3(estimate.q * true_pose.q.conjugate())});
                });
  return differences;
}

PoseErrors map_errors(std::span<const TagPlace> estimated, std::span<const TagPlace> truth,
                      int reference_tag) {
  const TagPlace* estimated_reference = find_tag(estimated, reference_tag);
  const TagPlace* true_reference = find_tag(truth, reference_tag);
  ErrorSum sum;
  if (estimated_reference == nullptr || true_reference == nullptr) return {};
  const Pose estimated_X_AW = estimated_reference->X_WT.inverse();
  const Pose true_X_AW = true_reference->X_WT.inverse();
  for (const TagPlace& tag : estimated) {
    const TagPlace* true_tag = find_tag(truth, tag.tag_id);
    if (true_tag == nullptr || tag.tag_id == reference_tag) continue;
    sum.add(estimated_X_AW * tag.X_WT, true_X_AW * true_tag->X_WT);
  }
  return sum.result();
}

std::optional<PoseErrors> fitted_map_errors(std::span<const TagPlace> estimated,
                                            std::span<const TagPlace> truth) {
  std::vector<std::pair<const TagPlace*, const TagPlace*>> pairs;
  for (const TagPlace& tag : estimated)
    if (const TagPlace* true_tag = find_tag(truth, tag.tag_id)) pairs.emplace_back(&tag, true_tag);
  if (pairs.size() < 2) return std::nullopt;
  // Corners instead of centres: tags in one line leave no rotation open.
  Eigen::Matrix3Xd from(3, 4 * pairs.size());
  Eigen::Matrix3Xd to(3, 4 * pairs.size());
  Eigen::Index column = 0;
  for (const auto& [tag, true_tag] : pairs) {
    for (int corner = 0; corner < 4; ++corner, ++column) {
      from.col(column) = tag->X_WT * tag_corner(corner, true_tag->edge_m);
      to.col(column) = true_tag->X_WT * tag_corner(corner, true_tag->edge_m);
    }
  }
  const Pose moved = rigid_fit(from, to);
  ErrorSum sum;
  for (const auto& [tag, true_tag] : pairs) sum.add(moved * tag->X_WT, true_tag->X_WT);
  return sum.result();
}

bool heading_along_x(const Pose& X_WT) {
  return std::abs((X_WT.q * Eigen::Vector3d::UnitX()).z()) <=
         std::abs((X_WT.q * Eigen::Vector3d::UnitY()).z());
}

Pose levelled(const Pose& X_WT, bool along_x) {
  const Eigen::Vector3d axis =
      X_WT.q * (along_x ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY());
  const double heading = std::atan2(axis.y(), axis.x());
  return {Eigen::Quaterniond(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ())), X_WT.p};
}

ReprojectionMeter::ReprojectionMeter(std::vector<CameraMount> cameras,
                                     std::span<const StampedPose> poses,
                                     std::span<const TagPlace> map)
    : cameras_(std::move(cameras)),
      half_period_(median_step(poses, cameras_.size()).value_or(Duration{0}) / 2) {
  add_part(poses, map);
}

void ReprojectionMeter::add_part(std::span<const StampedPose> poses,
                                 std::span<const TagPlace> map) {
  parts_.push_back({poses, {}});
  for (const TagPlace& tag : map) parts_.back().map.emplace(tag.tag_id, tag);
}

void ReprojectionMeter::add(const CornerFrame& frame) {
  ++counts_.frames;
  if (frame.tags.empty()) return;
  ++counts_.frames_with_tags;
  counts_.detections += static_cast<int>(frame.tags.size());
  for (const Part& part : parts_) {
    const StampedPose* pose = pose_near(part.poses, frame.exposed_at);
    if (pose == nullptr) continue;
    ++(&part == &parts_.front() ? counts_.frames_with_tags_and_pose
                                : counts_.frames_with_tags_in_parts);
    const CameraMount& camera = cameras_.at(static_cast<std::size_t>(frame.camera));
    const Pose X_VW = (pose->X_WB * camera.X_BV).inverse();
    for (const TagSighting& seen : frame.tags) score(seen, camera, X_VW, part.map);
    return;
  }
  counts_.without_pose += static_cast<int>(frame.tags.size());
}

const StampedPose* ReprojectionMeter::pose_near(std::span<const StampedPose> poses,
                                                Instant at) const {
  const auto after = std::ranges::lower_bound(poses, at, {}, &StampedPose::at);
  auto nearest = after;
  if (after == poses.end() || (after != poses.begin() && at - (after - 1)->at < after->at - at)) {
    if (after == poses.begin()) return nullptr;
    nearest = after - 1;
  }
  const Duration apart = nearest->at < at ? at - nearest->at : nearest->at - at;
  return apart <= half_period_ ? &*nearest : nullptr;
}

void ReprojectionMeter::score(const TagSighting& seen, const CameraMount& camera, const Pose& X_VW,
                              const std::map<int, TagPlace>& map) {
  const auto tag = map.find(seen.tag_id);
  if (tag == map.end()) {
    ++counts_.without_tag;
    return;
  }
  double squares = 0;
  for (int i = 0; i < 4; ++i) {
    const auto px =
        camera.model.project(X_VW * (tag->second.X_WT * tag_corner(i, tag->second.edge_m)));
    if (!px) {
      ++counts_.outside_camera;
      return;
    }
    squares += (*px - seen.corners_px[static_cast<std::size_t>(i)]).squaredNorm();
  }
  errors_px_.push_back(std::sqrt(squares / 4));
}

ReprojectionSummary ReprojectionMeter::summary() const {
  ReprojectionSummary summary = counts_;
  summary.scored = static_cast<int>(errors_px_.size());
  summary.median_px = quantile(errors_px_, 0.5);
  summary.p95_px = quantile(errors_px_, 0.95);
  summary.p95_of_all_px =
      quantile_of_all(errors_px_, static_cast<std::size_t>(summary.detections), 0.95);
  return summary;
}

}  // namespace fiducap
