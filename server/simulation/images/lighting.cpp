#include "simulation/images/lighting.hpp"

#include <cmath>

namespace fiducap::simulation {

double Lighting::at(const Eigen::Vector3d& p_W) const {
  const bool inside =
      (p_W.array() >= daylight_.low.array()).all() && (p_W.array() <= daylight_.high.array()).all();
  return inside ? daylight_.factor : 1.0;
}

double Lighting::exposure(const Trajectory& trajectory, const Pose& X_BV, double t_s) const {
  if (even()) return 1.0;
  // A first order lag of the light's logarithm: its past, weighted by exp(-age / lag), taken at
  // ages of equal weight.
  constexpr int kSteps = 32;
  double sum = 0;
  for (int k = 0; k < kSteps; ++k) {
    const double age_s = -lag_s_ * std::log(1 - (k + 0.5) / kSteps);
    sum += std::log(at(trajectory.at(t_s - age_s).X_WB * X_BV.p));
  }
  return std::exp(-sum / kSteps);
}

}  // namespace fiducap::simulation
