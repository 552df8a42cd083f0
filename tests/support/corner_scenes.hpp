#pragma once

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "base/pose.hpp"
#include "detection/tag_search.hpp"
#include "simulation/room_shape.hpp"
#include "unit/simulation/robot.hpp"
#include "unit/simulation/still_camera.hpp"

namespace fiducap {

/// A rendered image with its true corners.
struct CornerScene {
  CameraModel model;
  std::shared_ptr<const GrayImage> image;
  std::vector<ExpectedTag> tags;  ///< Exact; only those well inside of the image.
};

class RandomScene final {
 public:
  RandomScene(unsigned number, bool upright)
      : number_(number), upright_(upright), random_(number) {}

  CornerScene render(double light) {
    using namespace simulation;
    CornerScene scene;
    scene.model = number_ % 2 == 1 ? lens_camera() : plain_camera();
    CameraSimulation settings;
    settings.exposure_s = 0.01;
    settings.pixel_noise = scaled(0.8, 20);
    settings.vignetting = within(0, 0.8);
    const double distance = scaled(0.55, 7);
    std::vector<RecordedTag> tags;
    for (int i = 0; i < 6; ++i) tags.push_back(tag(i, distance));
    Pose X_WV = facing_camera(distance);
    const double yaw = within(-0.03, 0.03);
    const double pitch = within(-0.03, 0.03);
    X_WV.q = X_WV.q * exp_so3({yaw, pitch, within(-0.03, 0.03)});
    const double rate = within(0, 1) < 0.4 ? 0.0 : scaled(0.05, 2);
    const double about = within(0, 2 * M_PI);
    const EvenMotion motion(X_WV, Eigen::Vector3d::Zero(),
                            {rate * std::cos(about), rate * std::sin(about), 0});
    const DaylightConfig lamp{light, {-9, -9, -0.5}, {9, 9, 0.5}};  // the camera is outside
    scene.image =
        StillCamera(scene.model, settings, "clutter", lamp).photograph(motion, tags, number_);
    for (const RecordedTag& tag : tags) add_corners(scene, tag, X_WV);
    return scene;
  }

 private:
  double within(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double scaled(double low, double high) { return std::exp(within(std::log(low), std::log(high))); }
  RecordedTag tag(int i, double distance) {
    RecordedTag tag;
    tag.tag_id = static_cast<int>((number_ * 6 + static_cast<unsigned>(i)) % 587);
    tag.edge_m = 0.2;
    const double apart = std::max(0.34, 0.22 * distance * within(0.8, 1.2));
    const double x = apart * (i % 3 - 1) * within(1.08, 1.32);
    const double y = apart * (i / 3 - 0.5) * within(1.0, 1.2);
    tag.X_WT.p = {x, y, 0};
    const double tilt = std::acos(within(0.2, 1));
    const double towards = within(0, 2 * M_PI);
    const double turned = within(-M_PI, M_PI);
    const Eigen::Vector3d axis(std::cos(towards), std::sin(towards), 0);
    constexpr double kNearly = 0.02 / M_PI;
    tag.X_WT.q = upright_ ? exp_so3({0, std::copysign(tilt, towards - M_PI), 0}) *
                                exp_so3({0, 0, kNearly * turned})
                          : exp_so3(tilt * axis) * exp_so3({0, 0, turned});
    return tag;
  }
  static void add_corners(CornerScene& scene, const RecordedTag& tag, const Pose& X_WV) {
    constexpr double kBorder_px = 12;
    ExpectedTag expected{tag.tag_id, {}, 1.5};
    const auto corners = simulation::corners_of(tag);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto px = scene.model.project(X_WV.inverse() * corners[i]);
      if (!px || px->x() <= kBorder_px || px->y() <= kBorder_px ||
          px->x() >= scene.model.width - 1 - kBorder_px ||
          px->y() >= scene.model.height - 1 - kBorder_px)
        return;
      expected.corners_px[i] = *px;
    }
    scene.tags.push_back(expected);
  }

  unsigned number_;
  bool upright_;
  std::mt19937 random_;
};

/// Six tags of random size, tilt, blur and noise; 752 × 480, odd numbers with distortion.
/// @param number   determines the scene
/// @param light    on the tags, as a multiple of the light for the exposure
/// @param upright  tags on walls before a level camera: sides nearly along rows and columns
inline CornerScene make_corner_scene(unsigned number, double light = 1.0, bool upright = false) {
  return RandomScene(number, upright).render(light);
}

}  // namespace fiducap
