#pragma once

#include <functional>
#include <string>

#include "calibration_scene.hpp"

namespace fiducap {

/// A calibration, right or wrong. The calibration uses the plain board; the board in front of the
/// camera may differ.
struct VerdictInput {
  CameraModel camera{narrow_lens()};
  bool tags{false};  ///< Six tags at unknown places; else a checkerboard of 9 x 6 corners.
  double square_m{0.035};
  int views{110};  ///< Tried; the whole board must be in view.
  double noise_px{0.1};
  double reach{0.95};  ///< See CalibrationScene::look.
  double tilt_rad{0.8};
  std::uint64_t seed{1};
  /// Where a point of a target really is.
  std::function<Eigen::Vector3d(int target, const Eigen::Vector3d&)> print;
  std::function<double(int view)> zoom;  ///< Focal length, times that of the camera.
  double shutter_s{0};                   ///< Rolling, first row to last, …
  double hand_m_s{0};                    ///< … while the board moves to any side, …
  double hand_rad_s{0};                  ///< … and turns.
};

class VerdictStage final {
 public:
  explicit VerdictStage(const VerdictInput& input)
      : input_(input), scene_(input.camera, input.seed), random_(1000 + input.seed) {
    if (input.tags)
      scene_.add_tags(3, 2);
    else
      scene_.add_checkerboard(9, 6, input.square_m);
  }

  CalibrationData record() {
    for (int i = 0; i < input_.views; ++i) look(i);
    return scene_.data;
  }

 private:
  Eigen::Vector3d any() {
    std::normal_distribution<double> normal(0, 1);
    Eigen::Vector3d out;
    for (int i = 0; i < 3; ++i) out(i) = normal(random_);
    return out;
  }

  void look(int i) {
    CameraModel camera = input_.camera;
    if (input_.zoom) {
      camera.fu *= input_.zoom(i);
      camera.fv *= input_.zoom(i);
    }
    const Pose X_VB = scene_.board_pose(input_.reach, input_.tilt_rad);
    const Eigen::Vector3d v_B = input_.hand_m_s * any();
    const Eigen::Vector3d w_B = input_.hand_rad_s * any();
    CalibrationView view{"image " + std::to_string(i), {}};
    for (std::size_t t = 0; t < scene_.data.targets.size(); ++t)
      see(camera, X_VB, v_B, w_B, static_cast<int>(t), view);
    if (!view.sightings.empty()) scene_.data.views.push_back(std::move(view));
  }

  void see(const CameraModel& camera, const Pose& X_VB, const Eigen::Vector3d& v_V,
           const Eigen::Vector3d& w_B, int t, CalibrationView& view) {
    TargetSighting sighting;
    sighting.target = t;
    const auto& points = scene_.data.targets[static_cast<std::size_t>(t)].points;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d p_T = input_.print ? input_.print(t, points[i]) : points[i];
      const auto px = expose(camera, X_VB, v_V, w_B, scene_.place_of(t) * p_T);
      if (!px || px->x() < 2 || px->y() < 2 || px->x() > camera.width - 3 ||
          px->y() > camera.height - 3)
        return;
      const Eigen::Vector2d seen = *px + input_.noise_px * any().head<2>();
      sighting.points.push_back({static_cast<int>(i), seen, seen});
    }
    view.sightings.push_back(std::move(sighting));
  }

  /// Each row a little later than the one above.
  [[nodiscard]] std::optional<Eigen::Vector2d> expose(const CameraModel& camera, const Pose& X_VB,
                                                      const Eigen::Vector3d& v_V,
                                                      const Eigen::Vector3d& w_B,
                                                      const Eigen::Vector3d& p_B) const {
    auto px = camera.project(X_VB * p_B);
    constexpr int kRounds = 4;
    for (int i = 0; i < kRounds && px && input_.shutter_s > 0; ++i) {
      const double t_s = input_.shutter_s * (px->y() / camera.height - 0.5);
      px = camera.project(X_VB * (exp_so3(w_B * t_s) * p_B) + v_V * t_s);
    }
    return px;
  }

  VerdictInput input_;
  CalibrationScene scene_;
  std::mt19937_64 random_;
};

}  // namespace fiducap
