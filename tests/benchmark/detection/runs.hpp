#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "capture/camera_frame.hpp"
#include "detection/points/point_tracker.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::bench {

/// The benches' camera: 79° wide with a barrel lens at any resolution, looking along body x.
[[nodiscard]] inline CameraMount barrel_camera(int width, int height) {
  const double f = 460.0 * width / 752;
  CameraMount mount;
  mount.model = {width, height, f, f, 0.5 * (width - 1), 0.5 * (height - 1)};
  mount.model.distortion = Distortion::kRadialTangential;
  mount.model.coefficients = {-0.28, 0.07, 2e-4, 2e-5, 0};
  mount.X_BV = simulation::forward_camera();
  return mount;
}

/// One way to find the tags of the same images.
struct SearchArm {
  std::string name;
  std::vector<double> cpu_us{};  ///< One per image, thread CPU time.
  int found{};                   ///< Of the tags that are truly in view …
  int in_view{};
  int found_of_reference{};  ///< … and of those that the reference found.
  int reference{};
  int gross{};           ///< Found, but a corner more than a pixel off.
  double squares_px2{};  ///< Of the others.
  int coordinates{};
  /// Of images that were searched whole, after the start; −1: does not apply.
  double whole_share{-1};

  [[nodiscard]] double mean_us() const;
  [[nodiscard]] double rms_px() const;
};

struct TrackingRunSetup {
  std::string room{"hall"};
  int width{752};
  int height{480};
  int images{200};
  std::uint64_t seed{1};
};

/// Renders a robot's flight (camera 20 Hz with a lens, IMU 200 Hz). Every image is searched by
///  0 libapriltag over the whole image, decimate 1, with its defaults: the reference,
///  1 the same with the contrast threshold from the measured noise,
///  2 libapriltag over the whole image, decimate 2,
///  3 TagSearch with predictions from the truth of the image before at its velocity, 5 mm and 0.3°
///  off, 4 GuidedSearch behind the world filter, which starts without a map.
/// The first second is not counted: nothing is tracked yet.
[[nodiscard]] std::vector<SearchArm> run_tracking(const TrackingRunSetup& setup);

struct PointRunSetup {
  std::string room{"hall"};
  std::string texture{"sharp"};
  int width{752};
  int height{480};
  int images{200};
  std::uint64_t seed{1};
};

/// Points followed through rendered images, against the present images of the places on the walls
/// that they showed first.
struct PointRun {
  /// Errors of all tracks at one age, raw pixels; far off ones apart.
  struct AtAge {
    double squares_px2{};
    double products_px2{};  ///< … times the error one report before: the part that stays.
    int coordinates{};
    int gross{};  ///< More than kGross_px off, or a coordinate is.
  };
  static constexpr double kGross_px = 1.5;
  static constexpr int kAges = 20;
  std::vector<AtAge> ages{std::vector<AtAge>(kAges)};
  std::vector<double> cpu_ms;  ///< One per image.
  double points{};             ///< Mean per report.
  PointStatistics statistics;
};

/// Renders a robot's flight (752 × 480 with a lens, 20 Hz) and follows points, with the true
/// rotation of the camera.
[[nodiscard]] PointRun run_points(const PointRunSetup& setup);

/// Prints corner errors in rendered images and whether corner_sigma_px matches them: the mean of
/// (error / sigma)² in bins of size, shape, sharpness, blur, noise and tilt, on scenes that the
/// model was not fitted to.
void print_corner_calibration(int scenes);

}  // namespace fiducap::bench
