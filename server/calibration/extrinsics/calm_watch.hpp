#pragma once

#include <optional>

#include "base/time.hpp"
#include "calibration/extrinsics/sample_replay.hpp"
#include "capture/imu_sample.hpp"

namespace fiducap {

/// Whether a body hardly turns and hardly accelerates, as when it is held still by a hand: readings
/// are averaged over a twentieth of a second, the force is compared with its mean of half a second.
/// Readings that are not finite are passed over; where some are missing it begins anew.
///
/// A filter that knows its camera's place only roughly has to begin so: up is where the force
/// points. Begun in the middle of a wave it takes wrong branches, wrong by centimetres and sure to
/// millimetres (one start of eight).
class CalmWatch final {
 public:
  void add(const ImuSample& sample);
  /// It has been calm for long enough for a filter to begin where that began.
  [[nodiscard]] bool is_calm() const { return calm_s_ >= kLongEnough_s; }
  /// It has begun (anew): one reading is all it knows.
  [[nodiscard]] bool is_new() const { return samples_ <= 1; }
  /// Since so many seconds.
  [[nodiscard]] double calm_s() const { return calm_s_; }

 private:
  static constexpr double kLongEnough_s = 0.7;

  std::optional<Instant> last_at_;
  Eigen::Vector3d w_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d f_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d slow_f_{Eigen::Vector3d::Zero()};
  int samples_{0};
  double calm_s_{0};
};

/// @return the beginning of the first calm in which tags are in view
[[nodiscard]] std::optional<Instant> first_calm(const LoadedSamples& samples);

}  // namespace fiducap
