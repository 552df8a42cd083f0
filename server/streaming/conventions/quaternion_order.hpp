#pragma once

#include <array>

#include <Eigen/Geometry>

namespace fiducap {

/// A Hamilton quaternion in the order of a wire. Which protocol takes which:
/// protocol_conventions.hpp.
template <typename T = double>
[[nodiscard]] std::array<T, 4> xyzw(const Eigen::Quaterniond& q) {
  return {static_cast<T>(q.x()), static_cast<T>(q.y()), static_cast<T>(q.z()),
          static_cast<T>(q.w())};
}
template <typename T = double>
[[nodiscard]] std::array<T, 4> wxyz(const Eigen::Quaterniond& q) {
  return {static_cast<T>(q.w()), static_cast<T>(q.x()), static_cast<T>(q.y()),
          static_cast<T>(q.z())};
}

}  // namespace fiducap
