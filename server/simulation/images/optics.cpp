#include "simulation/images/optics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace fiducap::simulation {

namespace {

/// To undistort every corner takes half a second per camera. Every fourth one with cubic
/// interpolation agrees with the lens to 2e-4 px (tested).
constexpr int kGridStep = 4;

class CoarseGrid final {
 public:
  explicit CoarseGrid(const CameraModel& model)
      : model_(model), columns_(model.width / kGridStep + 4), rows_(model.height / kGridStep + 4) {
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column)
        nodes_.push_back(exact((column - 1) * kGridStep, (row - 1) * kGridStep));
    }
  }

  /// The ray point of a pixel corner; NaN outside the field of view.
  [[nodiscard]] Eigen::Vector2d exact(int column, int row) const {
    const auto ideal = undistort(model_, {column - 0.5, row - 0.5});
    if (!ideal) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    return {(ideal->px.x() - model_.cu) / model_.fu, (ideal->px.y() - model_.cv) / model_.fv};
  }

  [[nodiscard]] Eigen::Vector2d at(int column, int row) const {
    const auto wx = cubic(static_cast<double>(column % kGridStep) / kGridStep);
    const auto wy = cubic(static_cast<double>(row % kGridStep) / kGridStep);
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (int j = 0; j < 4; ++j) {
      for (int i = 0; i < 4; ++i) {
        const auto node =
            static_cast<std::size_t>((row / kGridStep + j) * columns_ + column / kGridStep + i);
        sum += wx[static_cast<std::size_t>(i)] * wy[static_cast<std::size_t>(j)] * nodes_[node];
      }
    }
    return sum.allFinite() ? sum : exact(column, row);  // near the edge of the field of view
  }

 private:
  /// Lagrange weights of the nodes at −1, 0, 1, 2.
  static std::array<double, 4> cubic(double t) {
    return {-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2,
            (t + 1) * t * (t - 1) / 6};
  }

  const CameraModel& model_;
  int columns_;
  int rows_;
  std::vector<Eigen::Vector2d> nodes_;
};

}  // namespace

double Lighting::at(const Eigen::Vector3d& p_W) const {
  const bool inside =
      (p_W.array() >= daylight_.low.array()).all() && (p_W.array() <= daylight_.high.array()).all();
  return inside ? daylight_.factor : 1.0;
}

double Lighting::exposure(const Trajectory& trajectory, const Pose& X_BV, double t_s) const {
  if (even()) return 1.0;
  // First-order lag of the light's logarithm, weight exp(-age / lag), at ages of equal weight.
  constexpr int kSteps = 32;
  double sum = 0;
  for (int k = 0; k < kSteps; ++k) {
    const double age_s = -lag_s_ * std::log(1 - (k + 0.5) / kSteps);
    sum += std::log(at(trajectory.at(t_s - age_s).X_WB * X_BV.p));
  }
  return std::exp(-sum / kSteps);
}

RayTable::RayTable(const CameraModel& model) : columns_(model.width + 1), rows_(model.height + 1) {
  const CoarseGrid grid(model);
  double widest = 0;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Eigen::Vector2d ray = grid.at(column, row);
      x_.push_back(static_cast<float>(ray.x()));
      y_.push_back(static_cast<float>(ray.y()));
      if (ray.allFinite()) widest = std::max(widest, ray.norm());
    }
  }
  widest_rad_ = std::atan(widest);
}

}  // namespace fiducap::simulation
