#include "detection/side_bend.hpp"

#include <Eigen/LU>
#include <cmath>

#include "detection/side_fit.hpp"

namespace fiducap {

namespace {

constexpr int kPointsPerSide = 21;
// The error is a small, slowly varying function of the corners. Two rounds, and nine points, would
// leave 0.002 px of large tags.
constexpr int kRounds = 3;

/// A line n·x = c, least squares through points.
struct Line {
  Eigen::Vector2d n;
  double c;
};

Line fit(const std::array<Eigen::Vector2d, kPointsPerSide>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : points) mean += p / kPointsPerSide;
  Eigen::Matrix2d C = Eigen::Matrix2d::Zero();
  for (const auto& p : points) C += (p - mean) * (p - mean).transpose();
  const double angle =
      0.5 * std::atan2(2 * C(0, 1), C(0, 0) - C(1, 1));  // direction of the longer axis
  const Eigen::Vector2d n(-std::sin(angle), std::cos(angle));
  return {n, n.dot(mean)};
}

Eigen::Vector2d meet(const Line& a, const Line& b) {
  Eigen::Matrix2d N;
  N << a.n.transpose(), b.n.transpose();
  return N.inverse() * Eigen::Vector2d(a.c, b.c);
}

}  // namespace

std::optional<std::array<Eigen::Vector2d, 4>> corners_of_fitted_sides(
    const CameraModel& camera, const std::array<Eigen::Vector2d, 4>& ideal_px) {
  std::array<Line, 4> sides;
  for (std::size_t i = 0; i < 4; ++i) {
    std::array<Eigen::Vector2d, kPointsPerSide> points;
    const Eigen::Vector2d along = ideal_px[(i + 1) % 4] - ideal_px[i];
    const double end = left_out_at_ends(along.norm());
    for (int k = 0; k < kPointsPerSide; ++k) {
      const double t = end + (1 - 2 * end) * (k + 0.5) / kPointsPerSide;
      const Eigen::Vector2d px = ideal_px[i] + t * along;
      const auto raw =
          camera.project({(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv, 1.0});
      if (!raw) return std::nullopt;
      points[static_cast<std::size_t>(k)] = *raw;
    }
    sides[i] = fit(points);
  }
  std::array<Eigen::Vector2d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) corners[i] = meet(sides[(i + 3) % 4], sides[i]);
  return corners;
}

std::array<Eigen::Vector2d, 4> unbend_corners(const CameraModel& camera,
                                              const std::array<Eigen::Vector2d, 4>& raw_px) {
  if (camera.distortion == Distortion::kNone) return raw_px;
  std::array<Eigen::Vector2d, 4> corrected = raw_px;
  for (int round = 0; round < kRounds; ++round) {
    std::array<Eigen::Vector2d, 4> ideal;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto pixel = undistort(camera, corrected[i]);
      if (!pixel) return raw_px;
      ideal[i] = pixel->px;
    }
    const auto fitted = corners_of_fitted_sides(camera, ideal);
    if (!fitted) return raw_px;
    for (std::size_t i = 0; i < 4; ++i) corrected[i] += raw_px[i] - (*fitted)[i];
  }
  return corrected;
}

}  // namespace fiducap
