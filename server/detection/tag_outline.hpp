#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Core>

namespace fiducap {

/// Size and shape of a tag in the image.
struct TagOutline {
  double longest_px{};  ///< Side.
  double
      width_px{};  ///< Area over that: between the two opposite sides that are closer. 0: no area.
};

[[nodiscard]] inline TagOutline outline_of(const std::array<Eigen::Vector2d, 4>& corners_px) {
  double doubled_area = 0;
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = corners_px[i];
    const Eigen::Vector2d& b = corners_px[(i + 1) % 4];
    longest = std::max(longest, (b - a).norm());
    doubled_area += a.x() * b.y() - b.x() * a.y();
  }
  return {longest, longest > 0 ? 0.5 * std::abs(doubled_area) / longest : 0.0};
}

}  // namespace fiducap
