#include "calibration/intrinsics/intrinsics_verdict.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "base/pose.hpp"

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

/// ∂ pixel / ∂ (lens parameters), and / ∂ rotation of the camera.
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

constexpr double kMinLensError_px = 0.03;  // for errors common to all images
constexpr double kTilted_rad = 25 * std::numbers::pi / 180;

double value_at_share(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  return nth_smallest(values,
                      static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

void count(const IntrinsicsCalibration& c, IntrinsicsVerdict& v) {
  std::vector<double> tilts;
  std::vector<double> distances;
  for (std::size_t i = 0; i < c.data.views.size(); ++i) {
    const CalibrationView& view = c.data.views[i];
    v.images += view.sightings.empty() ? 0 : 1;
    for (const TargetSighting& s : view.sightings) {
      const Pose X_VT = c.state.X_VT(i, s);
      // Relative to the image plane: only a variation of depth separates focal length and distance.
      const double facing = std::abs((X_VT.q * Eigen::Vector3d::UnitZ()).z());
      tilts.push_back(std::acos(std::min(1.0, facing)));
      distances.push_back(X_VT.p.norm());
      ++v.sightings;
      v.points += s.points.size();
      for (const SeenPoint& seen : s.points)
        if (const auto angle = angle_of(c.state.camera, seen.px))
          v.seen_angle_rad = std::max(v.seen_angle_rad, *angle);
    }
  }
  const auto tilted = std::ranges::count_if(tilts, [](double tilt) { return tilt > kTilted_rad; });
  v.tilted =
      static_cast<double>(tilted) / static_cast<double>(std::max<std::size_t>(1, tilts.size()));
  v.tilt_rad = value_at_share(tilts, 0.9);
  const double near = value_at_share(distances, 0.1);
  v.depth_spread = near > 0 ? value_at_share(distances, 0.9) / near : 1;
}

void measure_map(const IntrinsicsCalibration& c, const ImageMap& map, IntrinsicsVerdict& v) {
  constexpr double kEnoughForMean = 8;
  std::vector<double> uncertainties;
  int covered = 0;
  double systematic = 0;
  int filled = 0;
  for (const ImageCell& cell : map.cells) {
    covered += cell.points >= kCoveringPoints ? 1 : 0;
    if (cell.in_lens) uncertainties.push_back(cell.uncertainty_px);
    if (const auto angle = angle_of(c.state.camera, cell.centre_px))
      v.image_angle_rad = std::max(v.image_angle_rad, *angle);
    if (cell.points < kEnoughForMean) continue;
    systematic += cell.mean_px.squaredNorm() - 2 * c.sigma_px * c.sigma_px / cell.points;
    ++filled;
  }
  v.covered = covered / static_cast<double>(std::max<std::size_t>(map.cells.size(), 1));
  v.uncertainty_median_px = value_at_share(uncertainties, 0.5);
  v.uncertainty_worst_px = value_at_share(uncertainties, 1);
  v.misfit_px = filled > 0 ? std::sqrt(std::max(0.0, systematic / filled)) : 0;
  v.lens_error_px =
      std::max(kMinLensError_px, std::hypot(v.uncertainty_median_px, v.misfit_px / std::sqrt(2)));
}

void measure_numbers(const IntrinsicsCalibration& c, IntrinsicsVerdict& v) {
  double sum = 0;
  for (const Eigen::Vector2d& r : c.residuals) sum += r.squaredNorm();
  v.reprojection_rms_px =
      std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, c.residuals.size())));
  const auto& P = c.uncertainty.covariance;
  const CameraModel& camera = c.state.camera;
  v.focal_sigma = std::max(std::sqrt(P(0, 0)) / camera.fu, std::sqrt(P(1, 1)) / camera.fv);
  v.centre_sigma = std::sqrt(std::max(P(2, 2), P(3, 3))) / camera.width;
  v.shape = shape_of(camera);
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

IntrinsicsVerdict assess(const IntrinsicsCalibration& calibration, const ImageMap& map) {
  IntrinsicsVerdict verdict;
  count(calibration, verdict);
  measure_map(calibration, map, verdict);
  measure_numbers(calibration, verdict);
  add_advice(calibration, map, verdict);
  return verdict;
}

void set_lens_sigmas(const IntrinsicsCalibration& calibration, const IntrinsicsVerdict& verdict,
                     CameraMount& mount) {
  constexpr int kFirstRadial = 4;  // of LensVector: after fu fv cu cv
  const double k1_variance = calibration.uncertainty.covariance(kFirstRadial, kFirstRadial);
  const double more = verdict.uncertainty_median_px > 0
                          ? std::max(1.0, verdict.lens_error_px / verdict.uncertainty_median_px)
                          : 1.0;
  mount.focal_sigma = more * verdict.focal_sigma;
  mount.centre_sigma_px = more * verdict.centre_sigma * calibration.state.camera.width;
  mount.k1_sigma = more * std::sqrt(std::max(0.0, k1_variance));
  mount.lens_error_px = verdict.lens_error_px;
}

}  // namespace fiducap
