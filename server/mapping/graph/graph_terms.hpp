#pragma once

#include "estimation/segment/normal_equations.hpp"
#include "mapping/graph/graph_state.hpp"

namespace fiducap {

/// Positions of a graph's variables in its normal equations: nodes, then bodies' cameras, the
/// common scale of all tags, gravity, tags with their own scales.
class GraphVariables final {
 public:
  explicit GraphVariables(const GraphState& graph);

  [[nodiscard]] int node(std::size_t i) const { return static_cast<int>(i); }
  [[nodiscard]] int body(std::size_t i) const { return static_cast<int>(nodes_ + i); }
  [[nodiscard]] int common_scale() const { return static_cast<int>(nodes_ + bodies_); }
  [[nodiscard]] int gravity() const { return common_scale() + 1; }
  [[nodiscard]] int tag(std::size_t i) const { return gravity() + 1 + static_cast<int>(i); }
  [[nodiscard]] std::vector<int> sizes() const { return sizes_; }

 private:
  std::size_t nodes_;
  std::size_t bodies_;
  std::vector<int> sizes_;
};

/// The present estimate of a segment's variables, as errors against its linearisation point (in its
/// own axes).
[[nodiscard]] Eigen::VectorXd error_of(const GraphState& graph, const GraphSegment& segment);
[[nodiscard]] double cost_of(const SegmentFactor& factor, const Eigen::VectorXd& error);

/// @param only  component whose segments count; nullopt: those of all
[[nodiscard]] NormalEquations normal_equations(const GraphState& graph,
                                               const GraphVariables& variables,
                                               std::optional<int> only = std::nullopt);
/// Every variable moves by its rows of δ.
void move_by(const Eigen::VectorXd& delta, const GraphVariables& variables, const BlockMatrix& H,
             GraphState& graph);
/// ξ = (e, clock, readout, lens) of all cameras that leads from one to the other.
[[nodiscard]] Eigen::VectorXd error_between(const std::vector<CameraBelief>& from,
                                            const std::vector<CameraBelief>& to);

}  // namespace fiducap
