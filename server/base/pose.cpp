#include "base/pose.hpp"

#include <cmath>

namespace fiducap {

namespace {
// Below this angle the series is exact to double precision and the closed forms lose digits.
constexpr double kSmallAngle_rad = 1e-4;
}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d S;
  S << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return S;
}

Eigen::Quaterniond exp_so3(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  const double half = 0.5 * angle;
  const double sinc_half =
      angle < kSmallAngle_rad ? 0.5 - angle * angle / 48.0 : std::sin(half) / angle;
  const Eigen::Vector3d v = sinc_half * rotation_vector;
  return Eigen::Quaterniond(std::cos(half), v.x(), v.y(), v.z()).normalized();
}

Eigen::Vector3d log_so3(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q.vec();
  const double sin_half = v.norm();
  if (sin_half < kSmallAngle_rad) return (2.0 + sin_half * sin_half / 3.0) * v;
  return 2.0 * std::atan2(sin_half, sign * q.w()) / sin_half * v;
}

Eigen::Matrix3d left_jacobian_so3(const Eigen::Vector3d& rotation_vector) {
  const double angle2 = rotation_vector.squaredNorm();
  const double angle = std::sqrt(angle2);
  const Eigen::Matrix3d S = skew(rotation_vector);
  if (angle < kSmallAngle_rad) return Eigen::Matrix3d::Identity() + 0.5 * S + S * S / 6.0;
  const double a = (1.0 - std::cos(angle)) / angle2;
  const double b = (angle - std::sin(angle)) / (angle2 * angle);
  return Eigen::Matrix3d::Identity() + a * S + b * S * S;
}

double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return log_so3(a.conjugate() * b).norm();
}

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return Eigen::Quaterniond::FromTwoVectors(a, b);
}

}  // namespace fiducap
