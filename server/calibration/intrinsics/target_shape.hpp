#pragma once

#include <string>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// What the images say about the flatness and the sides of a board. Zero when there is no board, or
/// when the images do not show it.
struct TargetShape {
  std::string name;
  double size_m{};      ///< Longer side.
  double bend{};        ///< Middle against edge, out of the plane, in parts of the longer side.
  double bend_sigma{};  ///< 1-sigma.
  double stretch{};     ///< Sides x over y against what was said, minus one.
  double stretch_sigma{};
  bool known{false};
};

/// One Gauss-Newton step with the shape of the board that was seen most open, from a state adjusted
/// without: what bends a board cannot hide in lens and poses shows.
/// @param free  indices of the estimated lens numbers, ascending
[[nodiscard]] TargetShape look_at_shape(const CalibrationData& data, const CalibrationState& state,
                                        const std::vector<int>& free);

}  // namespace fiducap
