#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <utility>

#include <Eigen/Core>

#include "mapping/graph/block_cholesky.hpp"
#include "mapping/graph/graph_datum.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/graph/graph_terms.hpp"

namespace fiducap {

/// Tags that are bound closely enough to be asked for: seen in one segment or in two that follow
/// each other, or bound by the prior. first < second.
[[nodiscard]] std::set<std::pair<std::size_t, std::size_t>> bound_tags(const GraphState& graph);

/// How well a graph that has come to rest is known. Refers to the graph.
class GraphCovariance final {
 public:
  /// @return nullopt when something in it is not bound to anything
  [[nodiscard]] static std::optional<GraphCovariance> of(const GraphState& graph);

  /// From here on against the mean place and heading of these tags (see Datum).
  void refer_to(const std::vector<std::size_t>& tags);
  /// Of the plain errors of two tags; nullopt: they are not bound closely.
  [[nodiscard]] std::optional<Matrix6d> between(std::size_t first, std::size_t second) const;
  /// Of all that a segment's factor is over, in its order; errors on the world's side about W's
  /// origin. nullopt: not bound closely, which cannot be
  [[nodiscard]] std::optional<Eigen::MatrixXd> of(const GraphSegment& segment) const;
  /// Of one number, against what is held: one that has nothing to do with where W is.
  [[nodiscard]] double variance(int variable, int row) const;
  [[nodiscard]] const GraphVariables& variables() const { return variables_; }
  /// Of all bodies' cameras with everything: one column per number, against what is held.
  [[nodiscard]] Eigen::MatrixXd camera_columns() const;
  /// Rows of such columns: the plain errors of a tag, the numbers of a body's cameras.
  [[nodiscard]] Eigen::MatrixXd tag_rows(const Eigen::MatrixXd& columns, std::size_t tag) const;
  [[nodiscard]] Eigen::MatrixXd camera_rows(const Eigen::MatrixXd& columns, std::size_t body) const;

 private:
  GraphCovariance(const GraphState& graph, GraphVariables variables, BlockMatrix H,
                  BlockCholesky factor);

  const GraphState& graph_;
  GraphVariables variables_;
  BlockMatrix H_;
  BlockCholesky factor_;
  std::optional<Datum> datum_;
};

}  // namespace fiducap
