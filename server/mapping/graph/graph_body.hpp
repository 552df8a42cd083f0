#pragma once

#include <vector>

#include <Eigen/Core>

#include "estimation/segment/motion_segment.hpp"
#include "estimation/segment/segment_smoother.hpp"

namespace fiducap {

/// What the graph knows of a body as a whole.
struct GraphBody {
  int id{};
  std::vector<CameraBelief> cameras;
  std::vector<CameraBelief> expected;  ///< By the configuration, with …
  Eigen::MatrixXd information;         ///< … this information about all cameras' numbers.
};

/// As the configuration says.
[[nodiscard]] GraphBody body_by_configuration(int id, const SegmentSensors& sensors);

/// What a start has found of clocks and lenses may be far from what was expected: it begins there.
void begin_with(const std::vector<CameraBelief>& found, GraphBody& body);

}  // namespace fiducap
