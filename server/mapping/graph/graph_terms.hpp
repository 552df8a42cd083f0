#pragma once

#include "mapping/graph/block_cholesky.hpp"
#include "mapping/graph/graph_state.hpp"

namespace fiducap {

/// Where the variables of a graph stand in its normal equations: nodes, then bodies' cameras, the
/// scale of all prints, gravity, tags with the scale of their own.
class GraphVariables final {
 public:
  explicit GraphVariables(const GraphState& graph);

  [[nodiscard]] int node(std::size_t i) const { return static_cast<int>(i); }
  [[nodiscard]] int body(std::size_t i) const { return static_cast<int>(nodes_ + i); }
  [[nodiscard]] int prints() const { return static_cast<int>(nodes_ + bodies_); }
  [[nodiscard]] int gravity() const { return prints() + 1; }
  [[nodiscard]] int tag(std::size_t i) const { return gravity() + 1 + static_cast<int>(i); }
  [[nodiscard]] std::vector<int> sizes() const { return sizes_; }

 private:
  std::size_t nodes_;
  std::size_t bodies_;
  std::vector<int> sizes_;
};

/// Gauss–Newton about the present estimate: H δ = pull, cost there.
struct NormalEquations {
  explicit NormalEquations(const GraphVariables& variables)
      : H(variables.sizes()), pull(Eigen::VectorXd::Zero(H.rows())) {}
  BlockMatrix H;
  Eigen::VectorXd pull;
  double cost{0};
};

/// Where a segment's variables are now, as errors of where it was linearised (its own axes).
[[nodiscard]] Eigen::VectorXd error_of(const GraphState& graph, const GraphSegment& segment);
[[nodiscard]] double cost_of(const SegmentFactor& factor, const Eigen::VectorXd& error);

[[nodiscard]] NormalEquations normal_equations(const GraphState& graph,
                                               const GraphVariables& variables);
/// What is known of cameras, prints and gravity beside the segments and the GraphPrior.
/// @param out  gets it; nullptr: nobody does   @return its cost
double sensor_terms(const GraphState& graph, const GraphVariables& variables, NormalEquations* out);
/// Without the equations.
[[nodiscard]] double cost_of(const GraphState& graph);
/// Every variable moves by its rows of δ.
void move_by(const Eigen::VectorXd& delta, const GraphVariables& variables, const BlockMatrix& H,
             GraphState& graph);
/// ξ = (e, clock, readout, lens) of all cameras that leads from one to the other.
[[nodiscard]] Eigen::VectorXd error_between(const std::vector<CameraBelief>& from,
                                            const std::vector<CameraBelief>& to);

}  // namespace fiducap
