#pragma once

#include <array>
#include <string>

#include "base/expected.hpp"
#include "calibration/extrinsics/calm_watch.hpp"
#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "calibration/extrinsics/sample_replay.hpp"

namespace fiducap {

/// Where the motion stands that shows how camera and IMU sit on each other.
struct WaveProgress {
  std::array<double, 3> turned{};  ///< About each body axis: share of what is needed, 0 … 1.
  double shaken{};                 ///< The same of accelerations.
  double seen{};                   ///< … of images with tags.
  std::string hint;
  bool is_enough{};
};

/// Collects readings of an IMU and tags in images while a person waves the robot before tags, from
/// a moment on in which it was held still before them (CalmWatch), until every axis was turned
/// about and it was shaken. Solves nothing until asked.
class WaveGuide final {
 public:
  /// Turning faster than this counts. rad/s
  static constexpr double kTurning = 0.5;
  /// Of turning about each axis, s.
  static constexpr double kTurnedEnough_s = 4;

  void take(const ImuSample& sample);
  void take(CornerFrame corners);
  [[nodiscard]] const WaveProgress& progress() const { return progress_; }
  [[nodiscard]] const LoadedSamples& samples() const { return samples_; }
  void begin();

 private:
  void advise();
  void await_wave();
  [[nodiscard]] std::string hint() const;

  LoadedSamples samples_;
  CalmWatch calm_;
  bool is_ready_{false};  ///< Held still before tags, and now it may be waved.
  bool has_begun_{false};
  std::array<double, 3> turned_s_{};
  double shaken_s_{};
  double seen_s_{};
  Eigen::Vector3d mean_f_{Eigen::Vector3d::Zero()};
  WaveProgress progress_;
};

/// What is still wrong with a calibration, a sentence each; empty: good.
[[nodiscard]] std::vector<std::string> weaknesses_of(const CameraImuCalibration& calibration);

}  // namespace fiducap
