#include "pipeline/replay/placement_motion.hpp"

#include <algorithm>
#include <chrono>

#include "base/so3.hpp"

namespace fiducap {
namespace {

// A hand-carried body turns and moves this far at once; from kWander on, its variance grows with
// the time between.
constexpr double kTurnSigma_rad = 0.5;
constexpr double kMoveSigma_m = 1.0;
constexpr Duration kWander = std::chrono::seconds(2);
// A pose by a single image is no better than this.
constexpr double kImageTurn_rad = 0.1;
constexpr double kImageMove_m = 0.1;

}  // namespace

double motion_misfit(const StampedPose& a, const StampedPose& b, const Odometry* odometry) {
  const double seconds = to_seconds(std::chrono::abs(a.at - b.at));
  if (odometry != nullptr) {
    if (const auto moved = odometry->motion(a.at, b.at)) {
      const Pose expected = a.X_WB * *moved;
      const double turn_2 = kImageTurn_rad * kImageTurn_rad +
                            odometry->turn_noise_rad * odometry->turn_noise_rad * seconds;
      const double move_2 =
          kImageMove_m * kImageMove_m + odometry->move_noise_m * odometry->move_noise_m * seconds;
      const double turns = angle_between(expected.q, b.X_WB.q);
      return turns * turns / turn_2 + (expected.p - b.X_WB.p).squaredNorm() / move_2;
    }
  }
  const double turns = angle_between(a.X_WB.q, b.X_WB.q) / kTurnSigma_rad;
  const double moves = (a.X_WB.p - b.X_WB.p).norm() / kMoveSigma_m;
  return (turns * turns + moves * moves) / std::max(1.0, seconds / to_seconds(kWander));
}

}  // namespace fiducap
