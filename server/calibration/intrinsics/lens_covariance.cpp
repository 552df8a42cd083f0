#include "calibration/intrinsics/lens_covariance.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "calibration/intrinsics/reduced_system.hpp"

namespace fiducap {
namespace {

/// The scatter of what each image by itself pulls at the first `n` unknowns.
Eigen::MatrixXd scatter_of(const ReducedSystem& system, const Eigen::MatrixXd& inverse,
                           Eigen::Index n) {
  Eigen::MatrixXd seen = Eigen::MatrixXd::Zero(n, n);
  for (const Eigen::VectorXd& pull : system.pulls()) {
    const Eigen::VectorXd step = inverse.topRows(n) * pull;
    seen += step * step.transpose();
  }
  const auto views = static_cast<double>(system.pulls().size());
  if (views > 1) seen *= views / (views - 1);
  return seen;
}

}  // namespace

LensUncertainty uncertainty_of(const CalibrationData& data, const CalibrationState& state,
                               const std::vector<int>& free, double sigma_px) {
  LensUncertainty out;
  const ReducedSystem system(data, state, free);
  Eigen::MatrixXd inverse;
  if (!system.invert(inverse)) return out;
  const auto n = static_cast<Eigen::Index>(free.size());
  const Eigen::MatrixXd white = sigma_px * sigma_px * inverse.topLeftCorner(n, n);
  const Eigen::MatrixXd seen = scatter_of(system, inverse, n);
  out.correlation = white.ldlt().solve(seen).trace() / static_cast<double>(n);
  const double factor = std::max(1.0, out.correlation);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      out.covariance(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]) =
          factor * white(i, j);
  out.focal_scatter = std::sqrt(std::max(seen(0, 0) / white(0, 0), seen(1, 1) / white(1, 1)));
  out.condition = system.condition();
  out.determined = true;
  return out;
}

}  // namespace fiducap
