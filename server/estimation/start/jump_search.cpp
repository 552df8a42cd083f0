#include "estimation/start/jump_search.hpp"

#include <cmath>
#include <limits>

#include "base/numeric.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {

namespace {
constexpr int kSide = 40;
constexpr double kStep_s = 0.02;
// Bound of one corner's angle.
constexpr double kElsewhere_rad = 0.15;
// Residual of a right shift with IMU propagation and young tags, and the smallest residual.
constexpr double kFits_rad = 0.02;
constexpr double kFloor_rad = 0.005;
constexpr int kFewestImages = 6;
// Smallest ratio of mean squares to the best: without a jump, and at other shifts.
constexpr double kWorseWithout = 9;
constexpr double kWorseBeside = 4;
constexpr double kBeside_s = 0.1;
// Smaller shifts are estimated by the filter.
constexpr double kLeastJump_s = 0.03;
}  // namespace

JumpSearch::JumpSearch() : motions_(kMotions), ring_(kImages) {}

void JumpSearch::note_motion(Instant at, const Pose& X_AB) {
  const auto last = [&](std::size_t back) { return motions_[(moments_ - back) % kMotions].at; };
  if (moments_ > 0 && at < last(1)) forget_all();
  // Poses are at least a period apart, except the newest.
  if (moments_ > 1 && last(1) - last(2) < from_seconds(kMotionPeriod_s)) --moments_;
  motions_[moments_++ % kMotions] = {at, X_AB};
}

void JumpSearch::note_image(int camera, Instant stamp, std::span<const SightedTag> tags) {
  if (tags.empty()) return;
  Image& image = ring_[images_++ % kImages];
  image.camera = camera;
  image.stamp = stamp;
  image.X_BV = tags.front().X_BV;
  image.corners = 0;
  image.tag_id = tags.front().seen->tag_id;
  for (const SightedTag& tag : tags) {
    if (image.corners + 4 > kCorners) return;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector2d& px = tag.seen->corners_px[static_cast<std::size_t>(i)];
      image.point_A[image.corners] = tag.X_AT * tag_corner(i, tag.seen->edge_m);
      image.ray_V[image.corners++] = Eigen::Vector3d((px.x() - tag.camera->cu) / tag.camera->fu,
                                                     (px.y() - tag.camera->cv) / tag.camera->fv, 1)
                                         .normalized();
    }
  }
}

std::optional<Pose> JumpSearch::body_at(Instant at) const {
  const std::size_t count = std::min(moments_, kMotions);
  if (count < 2) return {};
  const auto moment = [&](std::size_t i) -> const Moment& {
    return motions_[(moments_ - count + i) % kMotions];
  };
  if (at < moment(0).at || at > moment(count - 1).at) return {};
  std::size_t before = 0;
  std::size_t after = count - 1;
  while (after - before > 1) {
    const std::size_t middle = (before + after) / 2;
    (moment(middle).at <= at ? before : after) = middle;
  }
  const Moment& a = moment(before);
  const Moment& b = moment(after);
  const double share = to_seconds(at - a.at) / to_seconds(b.at - a.at);
  return Pose{a.X_AB.q.slerp(share, b.X_AB.q), (1 - share) * a.X_AB.p + share * b.X_AB.p};
}

/// Mean square angle; nullopt: too few images at times of known motion.
std::optional<double> JumpSearch::misfit(int camera, Duration shift) const {
  double sum = 0;
  int images = 0;
  for (const Image& image : remembered()) {
    if (image.camera != camera || image.corners == 0) continue;
    const auto X_AB = body_at(image.stamp + shift);
    if (!X_AB) continue;
    const Pose X_VA = (*X_AB * image.X_BV).inverse();
    double of_image = 0;
    for (std::size_t k = 0; k < image.corners; ++k) {
      const Eigen::Vector3d seen_from = X_VA * image.point_A[k];
      const double angle = (seen_from.normalized() - image.ray_V[k]).norm();
      of_image += std::min(angle * angle, kElsewhere_rad * kElsewhere_rad);
    }
    sum += of_image / static_cast<double>(image.corners);
    ++images;
  }
  if (images < kFewestImages) return {};
  return sum / images;
}

bool JumpSearch::is_one_tag(int camera) const {
  const Image* first = nullptr;
  for (const Image& image : remembered()) {
    if (image.camera != camera) continue;
    if (first == nullptr) first = &image;
    if (image.tag_id != first->tag_id || image.corners > 4) return false;
  }
  return true;
}

/// Mean square angle of a moved tag, with its position fitted by least squares.
double JumpSearch::misfit_of_moved_tag(int camera, Duration known) const {
  Eigen::Matrix3d A = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double sum = 0;
  int images = 0;
  for (const Image& image : remembered()) {
    const auto X_AB = body_at(image.stamp + known);
    if (image.camera != camera || image.corners < 4 || !X_AB) continue;
    const Pose X_VA = (*X_AB * image.X_BV).inverse();
    Eigen::Vector3d centre_A = Eigen::Vector3d::Zero();
    Eigen::Vector3d ray = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
      centre_A += 0.25 * image.point_A[k];
      ray += image.ray_V[k];
    }
    const Eigen::Vector3d centre_V = X_VA * centre_A;
    const double range = std::max(centre_V.norm(), 1e-3);
    const Eigen::Vector3d n = centre_V / range;
    const Eigen::Vector3d off = ray.normalized() - n;
    const Eigen::Matrix3d J =
        (Eigen::Matrix3d::Identity() - n * n.transpose()) * X_VA.rotation() / range;
    A += J.transpose() * J;
    b += J.transpose() * off;
    sum += off.squaredNorm();
    ++images;
  }
  if (images < kFewestImages) return 0;
  return std::max(0.0, sum - b.dot(A.ldlt().solve(b))) / images;
}

std::optional<JumpSearch::Found> JumpSearch::find(int camera, Duration known) const {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const auto cost_of = [&](double shift_s) {
    return misfit(camera, known + from_seconds(shift_s)).value_or(kNone);
  };
  std::array<double, 2 * kSide + 1> cost;
  for (std::size_t i = 0; i < cost.size(); ++i)
    cost[i] = cost_of((static_cast<double>(i) - kSide) * kStep_s);
  const auto least = static_cast<std::size_t>(std::ranges::min_element(cost) - cost.begin());
  if (least == 0 || least + 1 == cost.size()) return {};
  if (!std::isfinite(cost[least - 1]) || !std::isfinite(cost[least + 1])) return {};
  const double best_s = (static_cast<double>(least) - kSide +
                         minimum_of_parabola(cost[least - 1], cost[least], cost[least + 1])) *
                        kStep_s;
  if (std::abs(best_s) < kLeastJump_s) return {};
  const double floor = std::max(cost_of(best_s), kFloor_rad * kFloor_rad);
  if (floor > kFits_rad * kFits_rad || cost[kSide] < kWorseWithout * floor) return {};
  for (std::size_t i = 0; i < cost.size(); ++i) {
    const double beside_s = std::abs((static_cast<double>(i) - kSide) * kStep_s - best_s);
    if (beside_s > kBeside_s && cost[i] < kWorseBeside * floor) return {};
  }
  return Found{best_s,
               !is_one_tag(camera) || misfit_of_moved_tag(camera, known) > kWorseBeside * floor};
}

}  // namespace fiducap
