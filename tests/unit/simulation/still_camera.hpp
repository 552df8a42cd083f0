#pragma once

#include <memory>

#include "base/pose.hpp"
#include "robot.hpp"
#include "simulation/images/image_camera.hpp"

namespace fiducap::simulation {

/// Constant velocity and angular rate; X_WB at t = 0.
class EvenMotion final : public Trajectory {
 public:
  explicit EvenMotion(const Pose& X_WB, const Eigen::Vector3d& v_WB = Eigen::Vector3d::Zero(),
                      const Eigen::Vector3d& w_WB_B = Eigen::Vector3d::Zero())
      : X_WB_(X_WB), v_WB_(v_WB), w_WB_B_(w_WB_B) {}
  [[nodiscard]] Point at(double t_s) const override {
    return {{X_WB_.q * exp_so3(w_WB_B_ * t_s), X_WB_.p + v_WB_ * t_s},
            v_WB_,
            Eigen::Vector3d::Zero(),
            w_WB_B_};
  }

 private:
  Pose X_WB_;
  Eigen::Vector3d v_WB_;
  Eigen::Vector3d w_WB_B_;
};

/// A camera whose body axes are its own, in a box of 10 m around the origin.
class StillCamera final {
 public:
  StillCamera(const CameraModel& model, const CameraSimulation& settings,
              const std::string& texture = "clutter", const DaylightConfig& sun = {})
      : camera_(mount(model), settings,
                {{Eigen::Vector3d::Constant(-5), Eigen::Vector3d::Constant(5)}, texture},
                std::move(*TagFamily::named("tag36h11")), sun) {}

  std::shared_ptr<const GrayImage> photograph(const Trajectory& motion,
                                              const std::vector<RecordedTag>& tags,
                                              std::uint64_t k = 0, int rows_at_once = 1 << 20) {
    camera_.begin({1, 0, k}, motion, 0.0, tags);
    while (!camera_.draw(rows_at_once)) {
    }
    return camera_.take();
  }

 private:
  static CameraMount mount(const CameraModel& model) {
    CameraMount made;
    made.model = model;
    return made;
  }
  ImageCamera camera_;
};

/// 376 × 240 pixels, so that tests stay quick.
inline CameraModel small_camera() { return {376, 240, 230, 230, 187.5, 119.5}; }
inline CameraModel small_lens_camera() {
  return radial_tangential({376, 240, 230, 229, 183.6, 124.2}, {-0.28, 0.07, 2e-4, 2e-5});
}
inline CameraModel small_fisheye_camera() {
  return equidistant({376, 240, 190, 190, 185, 122}, {-0.01, 0.02, -0.01, 0.002});
}

inline CameraSimulation clean_settings() {
  CameraSimulation settings;
  settings.exposure_s = 0;
  settings.pixel_noise = 0;
  settings.vignetting = 0;
  return settings;
}

/// Camera at distance d in front of a tag at the origin that faces z, image top along y.
inline Pose facing_camera(double distance) {
  return {exp_so3({std::numbers::pi, 0, 0}), {0, 0, distance}};
}

}  // namespace fiducap::simulation
