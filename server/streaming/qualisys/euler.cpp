#include "streaming/qualisys/euler.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fiducap::qualisys {

namespace {

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;
// Below this cosine of a2 the entries that a1 and a3 come from are rounding noise.
constexpr double kGimbalLock = 1e-9;

}  // namespace

Eigen::Vector3d euler_deg(const Eigen::Matrix3d& R) {
  const double a2 = std::asin(std::clamp(R(0, 2), -1.0, 1.0));
  const bool locked = std::hypot(R(0, 0), R(0, 1)) < kGimbalLock;
  const double a1 = locked ? std::atan2(R(2, 1), R(1, 1)) : std::atan2(-R(1, 2), R(2, 2));
  const double a3 = locked ? 0.0 : std::atan2(-R(0, 1), R(0, 0));
  return kDegreesPerRadian * Eigen::Vector3d(a1, a2, a3);
}

}  // namespace fiducap::qualisys
