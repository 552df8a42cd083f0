#include "simulation/told_lens.hpp"

#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Dense>

#include "base/pose.hpp"

namespace fiducap {

namespace {

constexpr int kNumbers = 8;  // fu fv cu cv k1 k2 p1 p2
constexpr int kSteps = 7;    // of the grid, each way
constexpr double kWide = 0.75;
constexpr double kHigh = 0.48;
constexpr double kSmall = 1e-6;
constexpr double kSharpCorner_px = 0.03;
// How far told_lens draws single numbers, for a pixel of error all over the image.
constexpr double kFocalPerPx = 0.02;
constexpr double kCentrePerPx = 10;
constexpr double kBendPerPx = 0.01;

std::vector<Eigen::Vector3d> grid() {
  std::vector<Eigen::Vector3d> rays;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j)
      rays.emplace_back(kWide * (2.0 * i / (kSteps - 1) - 1), kHigh * (2.0 * j / (kSteps - 1) - 1),
                        1);
  return rays;
}

Eigen::VectorXd seen(const CameraModel& lens, const Eigen::Matrix3d& turn) {
  const std::vector<Eigen::Vector3d> rays = grid();
  Eigen::VectorXd out(2 * static_cast<Eigen::Index>(rays.size()));
  for (std::size_t i = 0; i < rays.size(); ++i)
    out.segment<2>(2 * static_cast<Eigen::Index>(i)) = lens.project(turn * rays[i]).value();
  return out;
}

CameraModel changed(CameraModel lens, const Eigen::VectorXd& by) {
  lens.fu += by(0);
  lens.fv += by(1);
  lens.cu += by(2);
  lens.cv += by(3);
  for (std::size_t k = 0; k < 4; ++k) lens.coefficients[k] += by(4 + static_cast<Eigen::Index>(k));
  return lens;
}

}  // namespace

CameraModel told_lens(const CameraModel& lens, double rms_px, std::uint64_t seed) {
  const Eigen::VectorXd true_px = seen(lens, Eigen::Matrix3d::Identity());
  Eigen::MatrixXd turns(true_px.size(), 3);
  for (int axis = 0; axis < 3; ++axis)
    turns.col(axis) =
        (seen(lens, exp_so3(kSmall * Eigen::Vector3d::Unit(axis)).toRotationMatrix()) - true_px) /
        kSmall;
  const auto of_pictures = [&](const Eigen::VectorXd& by) {
    const Eigen::VectorXd off = seen(changed(lens, by), Eigen::Matrix3d::Identity()) - true_px;
    const Eigen::VectorXd rest = off - turns * turns.colPivHouseholderQr().solve(off);
    return std::sqrt(rest.squaredNorm() / static_cast<double>(rest.size()));
  };
  std::mt19937_64 random(seed * 977 + 3);
  std::normal_distribution<double> gauss;
  Eigen::VectorXd by(kNumbers);
  for (int k = 0; k < kNumbers; ++k) {
    const Eigen::VectorXd unit = kSmall * Eigen::VectorXd::Unit(kNumbers, k);
    by(k) = gauss(random) * kSmall / of_pictures(unit);
  }
  const double scale = rms_px / (of_pictures(kSmall * by) / kSmall);
  return changed(lens, scale * by);
}

EstimationData behind_a_told_lens(SimulatedDataSetup setup, double error_px, double told_px) {
  setup.lens_error_px = error_px;
  setup.corner_noise_px = kSharpCorner_px;
  EstimationData data = simulate(setup);
  data.camera.lens_error_px = told_px;
  data.camera.focal_sigma = kFocalPerPx * told_px;
  data.camera.centre_sigma_px = kCentrePerPx * told_px;
  data.camera.k1_sigma = kBendPerPx * told_px;
  return data;
}

}  // namespace fiducap
