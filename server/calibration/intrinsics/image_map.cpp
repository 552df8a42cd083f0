#include "calibration/intrinsics/image_map.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "base/so3.hpp"
#include "calibration/intrinsics/lens_derivative.hpp"

namespace fiducap {
namespace {

constexpr int kLongSide = 12;  // cells

ImageMap empty_map(int width, int height) {
  ImageMap map;
  const double side = std::max(width, height) / static_cast<double>(kLongSide);
  map.columns = std::max(3, static_cast<int>(std::lround(width / side)));
  map.rows = std::max(3, static_cast<int>(std::lround(height / side)));
  for (int row = 0; row < map.rows; ++row)
    for (int column = 0; column < map.columns; ++column) {
      ImageCell cell;
      cell.centre_px = {(column + 0.5) * width / map.columns - 0.5,
                        (row + 0.5) * height / map.rows - 0.5};
      map.cells.push_back(cell);
    }
  return map;
}

ImageCell& cell_of(ImageMap& map, const CalibrationData& data, const Eigen::Vector2d& px) {
  const auto place = [](double x, int size, int count) {
    return std::clamp(static_cast<int>((x + 0.5) * count / size), 0, count - 1);
  };
  const int column = place(px.x(), data.width, map.columns);
  const int row = place(px.y(), data.height, map.rows);
  return map.cells[static_cast<std::size_t>(row * map.columns + column)];
}

void count_residuals(const IntrinsicsCalibration& calibration, ImageMap& map) {
  std::size_t i = 0;
  for (const CalibrationView& view : calibration.data.views)
    for (const TargetSighting& sighting : view.sightings)
      for (const SeenPoint& seen : sighting.points) {
        ImageCell& cell = cell_of(map, calibration.data, seen.px);
        const Eigen::Vector2d& r = calibration.residuals[i++];
        ++cell.points;
        cell.rms_px += r.squaredNorm();
        cell.mean_px += r;
      }
  for (ImageCell& cell : map.cells) {
    if (cell.points == 0) continue;
    cell.rms_px = std::sqrt(cell.rms_px / cell.points);
    cell.mean_px /= cell.points;
  }
}

std::optional<Eigen::Vector3d> ray_of(const CameraModel& camera, const Eigen::Vector2d& raw_px) {
  constexpr double kWidest_rad = 1.55;
  const auto ideal = undistort(camera, raw_px, kWidest_rad);
  if (!ideal) return std::nullopt;
  return Eigen::Vector3d((ideal->px.x() - camera.cu) / camera.fu,
                         (ideal->px.y() - camera.cv) / camera.fv, 1)
      .normalized();
}

/// How a pixel moves with the lens numbers and with a turn of the camera.
struct CellDerivative {
  ImageCell* cell;
  Eigen::Matrix<double, 2, kLensNumbers> lens;
  Eigen::Matrix<double, 2, 3> turn;
};

void fill_uncertainty(const IntrinsicsCalibration& calibration, ImageMap& map) {
  const CameraModel& camera = calibration.state.camera;
  std::vector<CellDerivative> all;
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, kLensNumbers> B = Eigen::Matrix<double, 3, kLensNumbers>::Zero();
  for (ImageCell& cell : map.cells) {
    const auto ray = ray_of(camera, cell.centre_px);
    cell.in_lens = ray.has_value();
    if (!ray) continue;
    const LensDerivative at = differentiate(camera, *ray);
    all.push_back({&cell, at.d_lens, at.d_point * -skew(*ray)});
    A += cell.points * all.back().turn.transpose() * all.back().turn;
    B += cell.points * all.back().turn.transpose() * all.back().lens;
  }
  const Eigen::Matrix<double, 3, kLensNumbers> turn_by_lens = A.ldlt().solve(B);
  for (const CellDerivative& d : all) {
    const Eigen::Matrix<double, 2, kLensNumbers> J = d.lens - d.turn * turn_by_lens;
    const double variance = (J * calibration.uncertainty.covariance * J.transpose()).trace() / 2;
    d.cell->uncertainty_px = std::sqrt(std::max(variance, 0.0));
  }
}

}  // namespace

ImageMap make_image_map(const IntrinsicsCalibration& calibration) {
  ImageMap map = empty_map(calibration.data.width, calibration.data.height);
  count_residuals(calibration, map);
  fill_uncertainty(calibration, map);
  return map;
}

std::optional<double> angle_of(const CameraModel& camera, const Eigen::Vector2d& raw_px) {
  const auto ray = ray_of(camera, raw_px);
  if (!ray) return std::nullopt;
  return std::atan2(ray->head<2>().norm(), ray->z());
}

}  // namespace fiducap
