#include "simulation/rendered_corners.hpp"

#include "base/process.hpp"
#include "simulation/room_shape.hpp"

namespace fiducap {

namespace {

constexpr double kPredicted_px = 2.0;  // about what a filter's prediction is off

TagSetConfig print_of(const simulation::RoomConfig& room) {
  TagSetConfig print;
  print.family = room.family;
  return print;
}

}  // namespace

RenderedCorners::RenderedCorners(const simulation::RoomConfig& room, const CameraMount& camera)
    : camera_(camera), tags_(simulation::tags_of(room)), search_(print_of(room), {}) {}

void RenderedCorners::expect(const Pose& X_WV) {
  expected_.clear();
  const Pose X_VW = X_WV.inverse();
  for (const RecordedTag& tag : tags_) {
    const Eigen::Vector3d p = X_VW * tag.X_WT.p;
    const Eigen::Vector3d normal = X_VW.q * (tag.X_WT.q * Eigen::Vector3d::UnitZ());
    if (p.z() < 0.05 || -normal.dot(p) < 0.17 * p.norm()) continue;
    ExpectedTag expected{tag.tag_id, {}, kPredicted_px};
    const auto corners = simulation::corners_of(tag);
    bool inside = true;
    for (std::size_t i = 0; i < 4 && inside; ++i) {
      const auto px = camera_.model.project(X_VW * corners[i]);
      inside = px && px->x() > 0 && px->y() > 0 && px->x() < camera_.model.width - 1 &&
               px->y() < camera_.model.height - 1;
      if (inside) expected.corners_px[i] = *px;
    }
    if (inside) expected_.push_back(expected);
  }
}

CornerFrame RenderedCorners::look(const CameraFrame& image,
                                  const simulation::SimulatedSource& source) {
  const Pose X_WV = source.truth(image.exposed_at).X_WB * camera_.X_BV;
  expect(X_WV);
  CornerFrame found = search_.search(image, expected_);
  std::optional<Eigen::Quaterniond> turn;
  if (q_before_) turn = q_before_->conjugate() * X_WV.q;
  q_before_ = X_WV.q;
  const Duration begin = thread_cpu_time();
  const auto points = points_.follow(image, camera_.model, turn, found.tags);
  follow_cpu_s_ += to_seconds(thread_cpu_time() - begin);
  found.points.assign(points.begin(), points.end());
  return found;
}

}  // namespace fiducap
