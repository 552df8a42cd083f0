#pragma once

#include <map>
#include <vector>

#include <Eigen/Core>

#include "estimation/segment/motion_segment.hpp"
#include "estimation/segment/segment_smoother.hpp"

namespace fiducap {

/// Whether a number is as the configuration says (graph_doubts.hpp).
struct Doubt {
  bool is_open{};     ///< It was found not to be.
  double in_prior{};  ///< So much of the information that its being as configured, or open, means
                      ///< is in the GraphPrior already.
};

/// What the graph knows of a body as a whole.
struct GraphBody {
  int id{};
  std::vector<CameraBelief> cameras;
  std::vector<CameraBelief> expected;  ///< By the configuration, with …
  Eigen::MatrixXd information;         ///< … this information about all cameras' numbers.
  /// By their rows there: of numbers that are doubted.
  std::map<int, Doubt> doubts;
};

/// As the configuration says.
[[nodiscard]] GraphBody body_by_configuration(int id, const SegmentSensors& sensors);

/// What a start has found of clocks and lenses may be far from what was expected: it begins there.
void begin_with(const std::vector<CameraBelief>& found, GraphBody& body);

}  // namespace fiducap
