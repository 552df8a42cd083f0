#include "detection/corner_covariance.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

// Sine of the angle between two sides: flatter corners are not believed to be.
constexpr double kLeastSine = 0.02;

Eigen::Vector2d normal_of(const Eigen::Vector2d& side) {
  return Eigen::Vector2d(-side.y(), side.x()).normalized();
}

/// Where two lines meet, by how far each is moved along its normal.
Eigen::Matrix2d corner_by_sides(const Eigen::Vector2d& before, const Eigen::Vector2d& after) {
  const double cross = before.x() * after.y() - before.y() * after.x();
  const double sine = std::copysign(std::max(std::abs(cross), kLeastSine), cross);
  Eigen::Matrix2d out;
  out << after.y(), -before.y(), -after.x(), before.x();
  return out / sine;
}

}  // namespace

Matrix8d corner_covariance(const std::array<Eigen::Vector2d, 4>& corners_px,
                           const std::array<SideSigma, 4>& sides) {
  std::array<Eigen::Vector2d, 4> normals;
  for (std::size_t i = 0; i < 4; ++i)
    normals[i] = normal_of(corners_px[(i + 1) % 4] - corners_px[i]);
  // Corners by what each side is shifted (even columns) and turned (odd ones).
  Matrix8d by_sides = Matrix8d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t before = (i + 3) % 4;
    const auto row = static_cast<Eigen::Index>(2 * i);
    const auto of_before = static_cast<Eigen::Index>(2 * before);
    const Eigen::Matrix2d corner = corner_by_sides(normals[before], normals[i]);
    by_sides.block<2, 1>(row, of_before) = sides[before].shift_px * corner.col(0);
    by_sides.block<2, 1>(row, of_before + 1) = -sides[before].turn_px * corner.col(0);
    by_sides.block<2, 1>(row, row) = sides[i].shift_px * corner.col(1);
    by_sides.block<2, 1>(row, row + 1) = sides[i].turn_px * corner.col(1);
  }
  return by_sides * by_sides.transpose();
}

}  // namespace fiducap
