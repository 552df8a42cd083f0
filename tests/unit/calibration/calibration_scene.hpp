#pragma once

#include <cmath>
#include <random>

#include "base/pose.hpp"
#include "calibration/intrinsics/calibration_data.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {

inline CameraModel narrow_lens() {
  CameraModel camera{752, 480, 458, 456.5, 366.2, 249.1, Distortion::kRadialTangential, {}};
  camera.coefficients = {-0.283, 0.074, 2.0e-4, -1.8e-4, 0};
  return camera;
}

inline CameraModel fisheye_lens() {
  CameraModel camera{752, 480, 232, 231, 371.5, 244.3, Distortion::kEquidistant, {}};
  camera.coefficients = {0.012, -0.007, 0.004, -0.001, 0};
  return camera;
}

/// Of an Azure Kinect.
inline CameraModel rational_lens() {
  CameraModel camera{640, 360, 304.9, 304.8, 319.1, 183.4, Distortion::kRational, {}};
  camera.coefficients = {0.4523, -2.4876, 0.00063, -0.00012, 1.4311, 0.3316, -2.3187, 1.3622};
  return camera;
}

/// A board held before a camera, everywhere in its image, near and far, tilted to all sides.
class CalibrationScene final {
 public:
  explicit CalibrationScene(const CameraModel& camera, std::uint64_t seed = 1)
      : camera_(camera), random_(seed) {
    data.width = camera.width;
    data.height = camera.height;
  }

  /// One target of `columns` × `rows` points, `square` apart.
  void add_checkerboard(int columns, int rows, double square) {
    CalibrationTarget board{"checkerboard", {}, false};
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c)
        board.points.emplace_back((c - (columns - 1) / 2.0) * square,
                                  (r - (rows - 1) / 2.0) * square, 0);
    add_target(board, Pose{});
  }

  /// Tags of 0.1 m, 0.16 m apart, each turned a little on the board.
  void add_tags(int columns, int rows) {
    for (int i = 0; i < columns * rows; ++i) {
      CalibrationTarget tag{"tag " + std::to_string(i), {}, false};
      for (int k = 0; k < 4; ++k) tag.points.push_back(tag_corner(k, 0.1));
      const Eigen::Vector3d place((i % columns - (columns - 1) / 2.0) * 0.16,
                                  (i / columns - (rows - 1) / 2.0) * 0.16, 0.01 * (i % 3));
      add_target(tag, {exp_so3({0.05 * (i % 2), 0.03 * (i % 3), 0.2 * i}), place});
    }
  }

  /// @param reach  1: the board's middle comes to the border of the image; 0: stays in the middle
  void look(int views, double noise_px, double reach = 0.95, double tilt_rad = 0.7,
            bool tags_move = false) {
    for (int i = 0; i < views; ++i) {
      const Pose X_VB = board_pose(reach, tilt_rad);
      CalibrationView view{"image " + std::to_string(i), {}};
      for (std::size_t t = 0; t < data.targets.size(); ++t) {
        const Pose X_BT = tags_move ? X_BT_[t] * jump() : X_BT_[t];
        see(t, X_VB * X_BT, noise_px, view);
      }
      if (!view.sightings.empty()) data.views.push_back(std::move(view));
    }
  }

  /// Board in camera axes, random for each call.
  Pose board_pose(double reach, double tilt_rad) {
    const double down = uniform(-0.5, 0.5);
    const double across = uniform(-0.5, 0.5);
    const Eigen::Vector2d px(camera_.cu + reach * across * camera_.width,
                             camera_.cv + reach * down * camera_.height);
    const auto ideal = undistort(camera_, px);
    const Eigen::Vector3d ray = Eigen::Vector3d((ideal->px.x() - camera_.cu) / camera_.fu,
                                                (ideal->px.y() - camera_.cv) / camera_.fv, 1)
                                    .normalized();
    const double distance = uniform(0.35, 1.0) * camera_.fu / 300;
    const double turn = uniform(-3.1, 3.1);
    const Eigen::Vector3d tilt(tilt_rad * std::cos(turn), tilt_rad * std::sin(turn), 0);
    // Faces the camera (z of the target towards it), then tilted and rolled.
    const Eigen::Quaterniond facing(
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ray) *
        exp_so3({3.14159265, 0, 0}));
    const double rolled = uniform(-0.5, 0.5);
    const double tilted = uniform(0, 1);
    return {(facing * exp_so3(tilted * tilt) * exp_so3({0, 0, rolled})).normalized(),
            distance * ray};
  }

  [[nodiscard]] const Pose& place_of(int target) const {
    return X_BT_[static_cast<std::size_t>(target)];
  }

  CalibrationData data;

 private:
  void add_target(const CalibrationTarget& target, const Pose& X_BT) {
    data.targets.push_back(target);
    X_BT_.push_back(X_BT);
  }

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  Pose jump() { return {exp_so3({uniform(-0.3, 0.3), 0, 0}), {uniform(-0.05, 0.05), 0, 0}}; }

  void see(std::size_t t, const Pose& X_VT, double noise_px, CalibrationView& view) {
    if ((X_VT.q * Eigen::Vector3d::UnitZ()).dot(X_VT.p) > -0.1 * X_VT.p.norm()) return;
    TargetSighting sighting;
    sighting.target = static_cast<int>(t);
    const auto& points = data.targets[t].points;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto px = camera_.project(X_VT * points[i]);
      if (!px || px->x() < 2 || px->y() < 2 || px->x() > camera_.width - 3 ||
          px->y() > camera_.height - 3)
        return;
      std::normal_distribution<double> noise(0, noise_px);
      // One draw a statement: compilers differ in the order of arguments.
      Eigen::Vector2d seen = *px;
      seen.y() += noise(random_);
      seen.x() += noise(random_);
      sighting.points.push_back({static_cast<int>(i), seen, seen});
    }
    view.sightings.push_back(std::move(sighting));
  }

  CameraModel camera_;
  std::mt19937_64 random_;
  std::vector<Pose> X_BT_;
};

}  // namespace fiducap
