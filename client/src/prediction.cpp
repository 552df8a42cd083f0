#include "src/prediction.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap::sdk {

namespace {

using Vector = std::array<double, 3>;
using Quaternion = std::array<double, 4>;  // w x y z

// Time for which the acceleration is assumed to be constant.
constexpr double kAccelerationHolds_s = 0.1;

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// Unit quaternion of the rotation vector rate × dt.
Quaternion exponential(const Vector& rate, double dt) {
  const double speed = std::sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]);
  const double half = 0.5 * speed * dt;
  // sin(half) / speed, or its limit at zero.
  const double scale = std::abs(half) < 1e-9 ? 0.5 * dt : std::sin(half) / speed;
  return {std::cos(half), rate[0] * scale, rate[1] * scale, rate[2] * scale};
}

Quaternion normalized(const Quaternion& q) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm};
}

/// Errors of position and velocity are correlated, so their sigmas add.
void grow_sigmas(Body& body, double dt) {
  const double position = body.position_sigma_m + std::abs(dt) * body.velocity_sigma_m_s;
  const double rotation = body.rotation_sigma_rad + std::abs(dt) * body.rate_sigma_rad_s;
  const double by_position = body.position_sigma_m > 0 ? position / body.position_sigma_m : 1;
  const double by_rotation = body.rotation_sigma_rad > 0 ? rotation / body.rotation_sigma_rad : 1;
  body.position_sigma_m = position;
  body.rotation_sigma_rad = rotation;
  std::size_t at = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      const double scale =
          (row < 3 ? by_position : by_rotation) * (column < 3 ? by_position : by_rotation);
      body.pose_covariance[at] = static_cast<float>(body.pose_covariance[at] * scale);
      ++at;
    }
  }
}

}  // namespace

bool may_predict(std::chrono::nanoseconds ahead) {
  return ahead <= Client::kMaxPrediction && ahead >= -Client::kMaxPrediction;
}

void carry(Body& body, std::chrono::nanoseconds ahead) {
  const double dt = static_cast<double>(ahead.count()) * 1e-9;
  const double held_s = std::clamp(dt, -kAccelerationHolds_s, kAccelerationHolds_s);
  for (std::size_t i = 0; i < 3; ++i) {
    const double dv = body.acceleration_m_s2[i] * held_s;
    body.position_m[i] += body.velocity_m_s[i] * dt + dv * (dt - 0.5 * held_s);
    body.velocity_m_s[i] += dv;
  }
  body.orientation_wxyz =
      normalized(product(body.orientation_wxyz, exponential(body.body_rate_rad_s, dt)));
  body.age_s += dt;
  grow_sigmas(body, dt);
}

}  // namespace fiducap::sdk
