#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "base/pose.hpp"
#include "capture/camera_frame.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/body_filter.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap::bench {

inline constexpr double kImuRate_hz = 200;
inline constexpr int kImuPerImage = 10;

/// A camera that sways in front of a wall with tilted tags. Everything is known, so any of them can
/// be shown: ten to a row, and from the hundredth on in the places of the first again.
class Wall final {
 public:
  static constexpr double kEdge_m = 0.2;
  static constexpr double kMargin = 60;

  explicit Wall(int tags) {
    camera_.model = {752, 480, 460, 460, 376, 240, Distortion::kNone, {}};
    Eigen::Matrix3d R_BV;  // camera z along body x
    R_BV << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    camera_.X_BV = {Eigen::Quaterniond(R_BV), {0.05, 0, 0}};
    Eigen::Matrix3d facing;  // tag z against x, tag y up
    facing << 0, 0, -1, -1, 0, 0, 0, 1, 0;
    for (int i = 0; i < tags; ++i) {
      const double y = 0.32 * (i % 10 - 4.5);
      const double z = 0.26 * (i / 10 % 10 - 4.5);
      const Eigen::Vector3d tilt(0.45 * std::sin(1.7 * i), 0.5 + 0.2 * std::cos(2.3 * i), 0.1 * i);
      X_WT_.push_back({Eigen::Quaterniond(facing) * exp_so3(tilt), {3, y, z}});
    }
  }

  [[nodiscard]] BodySensors sensors() const {
    return {{camera_}, ImuNoise{1.2e-4, 2e-5, 2.3e-3, 5e-4, kImuRate_hz}};
  }

  [[nodiscard]] static ImuSample imu(int k) {
    const double t = k / kImuRate_hz;
    const Eigen::Vector3d a =
        -sway().cwiseProduct(speed().cwiseProduct(speed())).cwiseProduct(sines(t));
    return {instant(t), Eigen::Vector3d::Zero(), a + Eigen::Vector3d(0, 0, 9.81)};
  }

  /// `count` tags from number `first` on, at the instant of IMU sample k.
  [[nodiscard]] CornerFrame photograph(int k, int first, int count) {
    const double t = k / kImuRate_hz;
    CornerFrame frame{0, instant(t), {}};
    const Pose X_VW =
        (Pose{Eigen::Quaterniond::Identity(), sway().cwiseProduct(sines(t))} * camera_.X_BV)
            .inverse();
    for (int i = first; i < first + count && i < static_cast<int>(X_WT_.size()); ++i) {
      TagSighting tag;
      tag.tag_id = i;
      tag.decision_margin = kMargin;
      for (int c = 0; c < 4; ++c) {
        const auto corner = static_cast<std::size_t>(c);
        tag.corners_px[corner] = camera_.model.pinhole(
            X_VW * (X_WT_[static_cast<std::size_t>(i)] * tag_corner(c, kEdge_m)));
        tag.corners_px[corner] +=
            EstimatorConfig{}.corner_noise_px * Eigen::Vector2d(noise_(random_), noise_(random_));
      }
      frame.tags.push_back(tag);
    }
    return frame;
  }

  /// What a settled map says.
  [[nodiscard]] TagMap map() const {
    TagMap map;
    for (std::size_t i = 0; i < X_WT_.size(); ++i) {
      KnownTag known{static_cast<int>(i), kEdge_m, X_WT_[i], Matrix6d::Zero()};
      known.covariance.diagonal() << 1e-6, 1e-6, 1e-6, 4e-6, 4e-6, 4e-6;  // 1 mm, 2 mrad
      map.tags.push_back({known, TagState::kCalibrated, 0, 0, 0, 0});
    }
    return map;
  }

 private:
  static Instant instant(double t) { return instant_from_ns(0) + from_seconds(t); }
  static Eigen::Vector3d sway() { return {0.15, 0.2, 0.1}; }
  static Eigen::Vector3d speed() { return {1.3, 1.7, 2.1}; }
  static Eigen::Vector3d sines(double t) { return (speed() * t).array().sin(); }

  CameraMount camera_;
  std::vector<Pose> X_WT_;
  std::mt19937 random_{1};
  std::normal_distribution<double> noise_;
};

}  // namespace fiducap::bench
