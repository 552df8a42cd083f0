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
  /// Before a clock has jumped it was the body with this index in GraphState::bodies: all numbers
  /// but clocks are the same. -1: none.
  int same_as{-1};
};

/// As the configuration says.
[[nodiscard]] GraphBody body_by_configuration(int id, const SegmentSensors& sensors);

/// What a start has found of clocks and lenses may be far from what was expected: it begins there.
void begin_with(const std::vector<CameraBelief>& found, GraphBody& body);

/// The body since its cameras' clocks go otherwise.
/// @param before  with this index
[[nodiscard]] GraphBody with_other_clocks(const GraphBody& before, int index,
                                          const MotionSegment& since);
[[nodiscard]] bool has_other_clocks(const GraphBody& body, const MotionSegment& segment);
/// How surely the numbers of a camera are the same ones then, in the order of segment_layout: as
/// information; of the clock 0.
using SameNumbers = Eigen::Matrix<double, segment_layout::kCameraSize, 1>;
[[nodiscard]] SameNumbers information_of_same();

}  // namespace fiducap
