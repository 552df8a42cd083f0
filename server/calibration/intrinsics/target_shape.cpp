#include "calibration/intrinsics/target_shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "calibration/intrinsics/reduced_system.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kPointsOfBoard = 6;

/// The board with the most points seen; -1: there are tags only.
int board_of(const CalibrationData& data) {
  std::vector<std::size_t> seen(data.targets.size(), 0);
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& s : view.sightings)
      seen[static_cast<std::size_t>(s.target)] += s.points.size();
  int best = -1;
  for (std::size_t t = 0; t < seen.size(); ++t) {
    if (data.targets[t].points.size() < kPointsOfBoard || seen[t] == 0) continue;
    if (best < 0 || seen[t] > seen[static_cast<std::size_t>(best)]) best = static_cast<int>(t);
  }
  return best;
}

/// Largest bend over directions in the plane, of a ξ² + b ξη + c η²: half of it is that of a side.
double largest_bend(const Eigen::Vector3d& abc) {
  const double mean = (abc(0) + abc(2)) / 2;
  const double spread = std::hypot((abc(0) - abc(2)) / 2, abc(1) / 2);
  return std::max(std::abs(mean + spread), std::abs(mean - spread)) / 2;
}

}  // namespace

TargetShape look_at_shape(const CalibrationData& data, const CalibrationState& state,
                          const std::vector<int>& free) {
  TargetShape out;
  const int board = board_of(data);
  if (board < 0) return out;
  const CalibrationTarget& target = data.targets[static_cast<std::size_t>(board)];
  Eigen::Vector3d middle;
  out.name = target.name;
  out.size_m = 2 * half_side(target, middle);
  const ReducedSystem system(data, state, free, board);
  Eigen::MatrixXd inverse;
  if (!system.invert(inverse) || system.pulls().size() < 2) return out;
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(inverse.rows());
  for (const Eigen::VectorXd& share : system.pulls()) pull += share;
  const Eigen::VectorXd step = inverse * pull;
  // Noise as it is with the shape open: without, the shape itself looks like noise.
  const double variance =
      std::max(0.0, system.squares() - pull.dot(step)) / std::max(1.0, system.freedom());
  const Eigen::Matrix<double, kShapeNumbers, 1> shape = step.tail<kShapeNumbers>();
  const Eigen::Matrix<double, kShapeNumbers, 1> sigma =
      (variance * inverse.diagonal().tail<kShapeNumbers>()).cwiseSqrt();
  out.bend = largest_bend(shape.head<3>());
  out.bend_sigma = sigma.head<3>().norm() / 2;
  out.stretch = shape(3);
  out.stretch_sigma = sigma(3);
  out.known = true;
  return out;
}

}  // namespace fiducap
