#pragma once

#include <vector>

#include "simulation/room_shape.hpp"
#include "unit/simulation/still_camera.hpp"

namespace fiducap {

/// Six tags of 55 px, ids 0..5, three in a row, before a camera of 376 × 240 pixels in a box with
/// textured walls.
class RenderedWall final {
 public:
  explicit RenderedWall(double pixel_noise = 2.0, CameraModel model = simulation::small_camera())
      : model_(model), camera_(model, settings(pixel_noise)) {
    for (int i = 0; i < 6; ++i)
      tags.push_back(simulation::tag_at(i, 0.2, {0.36 * (i % 3 - 1), 0.36 * (i / 3 - 0.5), 0}));
  }

  /// Another `k` is another noise.
  std::shared_ptr<const GrayImage> photograph(std::uint64_t k = 0) {
    return camera_.photograph(simulation::EvenMotion(X_WV), tags, k);
  }

  /// True corners, raw pixels.
  [[nodiscard]] std::array<Eigen::Vector2d, 4> corners(const RecordedTag& tag) const {
    std::array<Eigen::Vector2d, 4> px;
    const auto corners_W = simulation::corners_of(tag);
    for (std::size_t i = 0; i < 4; ++i) px[i] = *model_.project(X_WV.inverse() * corners_W[i]);
    return px;
  }

  std::vector<RecordedTag> tags;
  Pose X_WV{simulation::facing_camera(0.84)};

 private:
  static simulation::CameraSimulation settings(double pixel_noise) {
    simulation::CameraSimulation s;
    s.pixel_noise = pixel_noise;
    return s;
  }
  CameraModel model_;
  simulation::StillCamera camera_;
};

}  // namespace fiducap
