#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Geometry>

namespace fiducap {

/// One point in two images of a camera that turned by a known amount in between.
struct TurnedPair {
  Eigen::Vector3d before;  ///< Ray (x, y, 1) in the earlier camera's axes …
  Eigen::Vector3d now;     ///< … and the later one's, turned into the earlier axes.
};

/// Which pairs fit one shift of the camera through a room that stands still. Two pairs make a guess
/// of the shift's direction (C. Troiani, A. Martinelli, C. Laugier, D. Scaramuzza, "2-point-based
/// outlier rejection for camera-IMU systems", ICRA 2014), the one that most agree with wins.
/// Deterministic: guesses are drawn from a fixed sequence.
class MotionCheck final {
 public:
  /// Memory for so many pairs.
  explicit MotionCheck(std::size_t usual = 0);

  /// @param limit  largest distance from the epipolar line, in units of the rays' x and y
  /// @return per pair whether it fits; all do when there are fewer than five. Valid until the next
  /// call.
  std::span<const char> fitting(std::span<const TurnedPair> pairs, double limit);

 private:
  std::vector<Eigen::Vector3d> normals_;
  std::vector<char> fits_;
  std::vector<char> best_;
};

}  // namespace fiducap
