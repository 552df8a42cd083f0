#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/segment/normal_equations.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/graph/graph_terms.hpp"

namespace fiducap {

/// The pose of W is a gauge freedom: it is defined by the mean place and heading of some tags
/// (inner constraints; Baarda, S-transformations and criterion matrices, 1973). Errors, which are
/// on the world's side, are transformed to those against that mean:
///
///     ξ' = ξ − N (Bᵀ N)⁻¹ Bᵀ ξ,   N: a common shift and yaw;  Bᵀ ξ: the mean's shift and yaw
class Datum final {
 public:
  /// @param defining  variables and poses of at least one tag; a single one defines the heading by
  /// its own
  Datum(std::span<const std::pair<int, Pose>> defining, const BlockCholesky& factor,
        const BlockMatrix& matrix);

  /// The first rows of a variable.
  struct Rows {
    int variable{};
    int size{6};
    bool is_in_workspace{true};  ///< Its first six are a pose in W.
  };
  /// Covariance between two variables, against the mean.
  /// @param raw  against the tags that were held
  [[nodiscard]] Eigen::MatrixXd between(const Rows& a, const Rows& b,
                                        const Eigen::MatrixXd& raw) const;

 private:
  std::vector<int> first_;  ///< Row of each variable.
  Eigen::Matrix4d M_;
  Eigen::MatrixXd C_;  ///< Σ B
  Eigen::Matrix4d T_;  ///< Bᵀ Σ B
};

/// Pairs of tags whose covariance is available: seen in one segment or in two consecutive ones, or
/// connected by the prior. first < second.
[[nodiscard]] std::set<std::pair<std::size_t, std::size_t>> bound_tags(const GraphState& graph);

/// Covariances of a converged graph. Refers to the graph.
class GraphCovariance final {
 public:
  /// @param only  component whose segments count; nullopt: those of all
  /// @return nullopt: the problem is singular
  [[nodiscard]] static std::optional<GraphCovariance> of(const GraphState& graph,
                                                         std::optional<int> only = std::nullopt);

  /// From here on against the mean place and heading of these tags (see Datum).
  void refer_to(const std::vector<std::size_t>& tags);
  /// Of the plain errors of two tags; nullopt: not available.
  [[nodiscard]] std::optional<Matrix6d> between(std::size_t first, std::size_t second) const;
  /// Of all variables of a segment's factor, in its order; errors on the world's side about W's
  /// origin. nullopt: not available, which cannot be
  [[nodiscard]] std::optional<Eigen::MatrixXd> of(const GraphSegment& segment) const;
  /// Of one parameter that does not depend on the gauge.
  [[nodiscard]] double variance(int variable, int row) const;
  [[nodiscard]] const GraphVariables& variables() const { return variables_; }
  /// Of all variables with all bodies' camera parameters: one column per parameter, against the
  /// tags that are held.
  [[nodiscard]] Eigen::MatrixXd camera_columns() const;
  /// Rows of such columns: the plain errors of a tag, the camera parameters of a body.
  [[nodiscard]] Eigen::MatrixXd tag_rows(const Eigen::MatrixXd& columns, std::size_t tag) const;
  [[nodiscard]] Eigen::MatrixXd camera_rows(const Eigen::MatrixXd& columns, std::size_t body) const;

 private:
  GraphCovariance(const GraphState& graph, GraphVariables variables, BlockMatrix H,
                  BlockCholesky factor);
  [[nodiscard]] std::optional<Eigen::MatrixXd> block(const Datum::Rows& a,
                                                     const Datum::Rows& b) const;

  const GraphState& graph_;
  GraphVariables variables_;
  BlockMatrix H_;
  BlockCholesky factor_;
  std::optional<Datum> datum_;
};

/// A body's pose at one instant, smoothed by all segments before and after.
struct PathPose {
  Instant at{};
  Pose X_WB;
  Matrix6d covariance{Matrix6d::Zero()};  ///< Place and rotation vector, both in W axes.
};

/// A body's poses at all instances of its segments of one component, in order of time.
/// @param covariance  of this graph, converged; nullptr: the poses have none
/// @return nullopt: a number is not finite
[[nodiscard]] std::optional<std::vector<PathPose>> path_of(int body_id, const GraphState& graph,
                                                           const GraphCovariance* covariance,
                                                           int component = kInWorkspace);

}  // namespace fiducap
