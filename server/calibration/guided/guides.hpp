#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "calibration/extrinsics/loaded_samples.hpp"
#include "calibration/imu/imu_calibration.hpp"
#include "calibration/intrinsics/calibration_data.hpp"
#include "calibration/intrinsics/view_collector.hpp"
#include "detection/no_tag.hpp"

// Guides collect the data of a calibration and show the user what to do next. They solve nothing.
namespace fiducap {

/// For the user who holds a sheet in front of a camera.
struct LensProgress {
  int columns{};
  int rows{};
  std::vector<int> points;  ///< Per cell of the image, row by row from the top.
  double covered{};         ///< Share of cells with enough points.
  std::size_t views{};      ///< Kept.
  std::size_t tilted{};     ///< Kept views with a slanted sheet.
  std::string hint;         ///< What to do next, a sentence.
  bool is_enough{};         ///< For a good lens.
};

/// Collects images of a target: keeps those that are sharp, still and different from the others,
/// and counts coverage and slants.
class LensGuide final {
 public:
  /// Kept at most: more would make the solution slow and hardly better.
  static constexpr std::size_t kMostViews = 80;

  /// @param width, height  of every image
  LensGuide(CalibrationTargets targets, int width, int height);

  /// @return whether the image is kept
  bool look(const std::shared_ptr<const GrayImage>& image);
  /// The same with detected corners.
  bool look(const CornerFrame& corners);
  [[nodiscard]] const LensProgress& progress() const { return progress_; }
  [[nodiscard]] CalibrationData data() const;
  /// After a solution that was not good: requests this number of additional views.
  /// @param why  shown as the hint
  void request_more(std::size_t views, std::string why);

 private:
  bool consider(std::optional<CalibrationView> view);
  [[nodiscard]] bool is_sharp(const CalibrationView& view);
  void count(const CalibrationView& view);
  void advise();
  [[nodiscard]] std::string missing_part() const;

  NoTagAdvice no_tag_;
  ViewCollector collector_;
  int width_;
  int height_;
  std::vector<CalibrationView> views_;
  CalibrationView last_;
  double sharpest_{0};
  std::size_t required_views_;
  std::string request_{};  ///< From request_more.
  std::string problem_{};  ///< Of the last image.
  LensProgress progress_;
};

/// Slant of a square: the cosine of the angle between line of sight and normal, from its four
/// corners (ratio of the singular values of their affine part).
[[nodiscard]] double slant_cosine(const std::array<Eigen::Vector2d, 4>& corners);

/// Collects samples of an IMU until it has been at rest for long enough.
class RestGuide final {
 public:
  /// A minute determines the white noise to a percent, and an upper bound of the walk.
  static constexpr double kLongEnough_s = 62;

  void take(const ImuSample& sample);
  /// Of the required time, 0 … 1.
  [[nodiscard]] double share() const;
  [[nodiscard]] std::string hint() const;
  [[nodiscard]] bool is_enough() const { return share() >= 1; }
  /// @return Error when it moved; call begin() then
  [[nodiscard]] Expected<StaticImuNoise> result() const;
  void begin();

 private:
  std::vector<ImuSample> samples_;
  Eigen::Vector3d mean_w_{Eigen::Vector3d::Zero()};  ///< Of the first second.
  Eigen::Vector3d mean_f_{Eigen::Vector3d::Zero()};
  int averaged_{0};
  bool moved_{false};  ///< Before samples_.front().
};

/// Of the motion that determines the extrinsics of camera and IMU.
struct WaveProgress {
  std::array<double, 3> turned{};  ///< About each body axis: share of what is needed, 0 … 1.
  double shaken{};                 ///< The same of accelerations.
  double seen{};                   ///< The same of images with tags.
  std::string hint;
  bool is_enough{};
};

/// Collects IMU samples and tags while the user waves the robot in front of tags, from a rest with
/// tags in view on (StillnessDetector), until it was rotated about all axes and shaken.
class WaveGuide final {
 public:
  /// Faster rotations count, rad/s.
  static constexpr double kTurning = 0.5;
  /// Required time of rotation about each axis, s.
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
  StillnessDetector stillness_;
  bool is_ready_{false};  ///< Still with tags in view: the wave may begin.
  bool has_begun_{false};
  std::array<double, 3> turned_s_{};
  double shaken_s_{};
  double seen_s_{};
  Eigen::Vector3d mean_f_{Eigen::Vector3d::Zero()};
  WaveProgress progress_;
};

/// Weaknesses of a calibration, a sentence each; empty: good.
[[nodiscard]] std::vector<std::string> weaknesses_of(const CameraImuCalibration& calibration);

}  // namespace fiducap
