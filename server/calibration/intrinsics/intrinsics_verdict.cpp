#include "calibration/intrinsics/intrinsics_verdict.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibration/intrinsics/intrinsics_advice.hpp"

namespace fiducap {
namespace {

// Corners of a calibration's images are off together by more than their scatter tells.
constexpr double kLeastLensError_px = 0.03;
constexpr double kTilted_rad = 25 * std::numbers::pi / 180;

/// The value that this share of all is below.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

void count(const IntrinsicsCalibration& c, IntrinsicsVerdict& v) {
  std::vector<double> tilts;
  std::vector<double> distances;
  for (std::size_t i = 0; i < c.data.views.size(); ++i) {
    const CalibrationView& view = c.data.views[i];
    v.images += view.sightings.empty() ? 0 : 1;
    for (const TargetSighting& s : view.sightings) {
      const auto t = static_cast<std::size_t>(s.target);
      const Pose X_VT = c.state.X_VG[i].at(c.state.group_of[t]) * c.state.X_GT[t];
      // Against the image plane, not the line of sight: only what is nearer on one side than on the
      // other tells focal length from distance.
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
  const auto tilted =
      std::count_if(tilts.begin(), tilts.end(), [](double tilt) { return tilt > kTilted_rad; });
  v.tilted =
      static_cast<double>(tilted) / static_cast<double>(std::max<std::size_t>(1, tilts.size()));
  v.tilt_rad = quantile(tilts, 0.9);
  const double near = quantile(distances, 0.1);
  v.depth_spread = near > 0 ? quantile(distances, 0.9) / near : 1;
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
  v.uncertainty_median_px = quantile(uncertainties, 0.5);
  v.uncertainty_worst_px = quantile(uncertainties, 1);
  v.misfit_px = filled > 0 ? std::sqrt(std::max(0.0, systematic / filled)) : 0;
  v.lens_error_px =
      std::max(kLeastLensError_px, std::hypot(v.uncertainty_median_px, v.misfit_px / std::sqrt(2)));
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

IntrinsicsVerdict judge(const IntrinsicsCalibration& calibration, const ImageMap& map) {
  IntrinsicsVerdict verdict;
  count(calibration, verdict);
  measure_map(calibration, map, verdict);
  measure_numbers(calibration, verdict);
  give_advice(calibration, map, verdict);
  return verdict;
}

void tell_lens(const IntrinsicsCalibration& calibration, const IntrinsicsVerdict& verdict,
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
