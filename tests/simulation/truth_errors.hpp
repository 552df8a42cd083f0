#pragma once

#include <span>
#include <vector>

#include "estimation/known_tag.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// Place, then rotation vector, in the axes in which both poses are.
[[nodiscard]] Vector6d pose_error(const Pose& estimate, const Pose& truth);

/// eᵀ P⁻¹ e
[[nodiscard]] double normalised(const Eigen::VectorXd& e, const Eigen::MatrixXd& P);

/// RMSE of a map's tags; those that the data does not have are left out.
struct MapErrors {
  std::vector<int> ids;
  double position_m{};  ///< In the workspace.
  double rotation_rad{};
  int others{};              ///< But the reference tag.
  double near_position_m{};  ///< Of those, in the reference tag's axes.
  double near_rotation_rad{};
  double nees{};  ///< Of those, in the workspace: mean per degree of freedom.
};
/// @param X_WR  room axes → workspace
/// @param X_WT  the reference tag as the map has it
[[nodiscard]] MapErrors map_errors(std::span<const KnownTag> map, const EstimationData& data,
                                   const Pose& X_WR, const Pose& X_WT);

}  // namespace fiducap
