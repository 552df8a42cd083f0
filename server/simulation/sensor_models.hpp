#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "base/time.hpp"
#include "capture/camera_frame.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "simulation/random.hpp"
#include "simulation/simulation.hpp"

/// Models of the sensors: IMU, camera without images, faults.
namespace fiducap::simulation {

/// Three-dimensional Brownian motion on a grid of ticks: zero at tick 0, each step has variance 1
/// per axis. Lévy's midpoint construction with hashed keys: ticks can be evaluated in any order
/// with the same result. The next tick costs two draws, any other at most `kLevels`.
class RandomWalk final {
 public:
  RandomWalk(std::uint64_t seed, Purpose purpose);
  /// @pre tick <= 2^kLevels (at 1 kHz: 34 years)
  [[nodiscard]] Eigen::Vector3d at(std::uint64_t tick);

  static constexpr int kLevels = 40;

 private:
  struct Interval {
    std::uint64_t low{};
    std::uint64_t high{};
    Eigen::Vector3d at_low;
    Eigen::Vector3d at_high;
  };

  std::uint64_t seed_;
  Purpose purpose_;
  std::array<Interval, kLevels + 1> path_;  ///< Nested halves down to the last tick.
  std::size_t depth_{0};
};

/// The true biases at an instant.
struct ImuBias {
  Eigen::Vector3d w;
  Eigen::Vector3d f;
};

/// An IMU: samples of rate and specific force with scale error, misalignment, bias walk, white
/// noise and saturation. Sample k depends only on the seed and k.
class ImuModel final {
 public:
  ImuModel(const ImuErrors& errors, double gravity_m_s2, std::uint64_t seed);
  /// @param truth  at t = k / rate  @return the sample without its stamp
  [[nodiscard]] ImuSample measure(std::uint64_t k, const Trajectory::Point& truth);
  /// At any time, interpolated linearly between samples. Thread-safe.
  [[nodiscard]] ImuBias bias_at(double t_s) const;

 private:
  ImuErrors errors_;
  double gravity_m_s2_;
  std::uint64_t seed_;
  Eigen::Matrix3d gyro_gain_;  ///< Scale and misalignment.
  Eigen::Matrix3d accel_gain_;
  RandomWalk gyro_walk_;
  RandomWalk accel_walk_;
};

/// Specific force at the body's origin, as an accelerometer without errors measures it.
[[nodiscard]] inline Eigen::Vector3d specific_force(const Trajectory::Point& truth,
                                                    double gravity_m_s2) {
  return truth.X_WB.q.conjugate() * (truth.a_WB + Eigen::Vector3d(0, 0, gravity_m_s2));
}

/// Identifies an image; key of its noise.
struct ImageKey {
  std::uint64_t seed{};
  int camera{};
  std::uint64_t k{};  ///< Counts the exposures of this camera, including dropped ones.
};

/// X_WV when a row is exposed. @param row  −0.5 first … +0.5 last row of the image
using CameraPath = std::function<Pose(double row)>;

/// Sightings of a detector without rendering: projected corners with white noise, by the rules of
/// CameraSimulation (corners inside the image, side, tilt, probability). Sorted by id; ids that
/// appear twice are left out, as in TagDetector.
/// @param X_WV  equal for all rows with a global shutter
/// @param tags  poses and ids in this image
void sight_corners(const CameraModel& model, const CameraPath& X_WV,
                   const std::vector<RecordedTag>& tags, const CameraSimulation& rules,
                   const ImageKey& key, std::vector<TagSighting>& out);

/// Applies the faults of FaultConfig. Each result depends only on the seed and the sample.
class Faults final {
 public:
  /// @param ids  number of ids of the family, from which wrong ones are drawn
  Faults(const FaultConfig& config, int ids, std::uint64_t seed)
      : config_(config), ids_(ids), seed_(seed) {}

  [[nodiscard]] bool drops_imu(std::uint64_t k) const;
  [[nodiscard]] Duration imu_delay(std::uint64_t k) const;
  /// Dropped by chance or in a blackout.
  [[nodiscard]] bool drops_image(int camera, std::uint64_t k, double t_s) const;
  [[nodiscard]] Duration image_delay(int camera, std::uint64_t k) const;
  /// Removes hidden tags, moves the moved one, replaces ids by wrong ones. Keeps the order.
  void change_tags(int camera, std::uint64_t k, double t_s, std::vector<RecordedTag>& tags) const;
  /// Moves covered corners to where a detector would find them.
  void cover_corners(int camera, std::uint64_t k, std::vector<TagSighting>& sightings) const;
  /// Stamp minus true time.
  [[nodiscard]] Duration image_stamp_error() const;
  [[nodiscard]] Duration imu_stamp_error(std::uint64_t k, double rate_hz) const;
  void saturate(double t_s, ImuSample& imu) const;

 private:
  FaultConfig config_;
  int ids_;
  std::uint64_t seed_;
};

}  // namespace fiducap::simulation
