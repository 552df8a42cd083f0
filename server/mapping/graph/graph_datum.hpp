#pragma once

#include <map>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "estimation/known_tag.hpp"
#include "mapping/graph/block_cholesky.hpp"

namespace fiducap {

/// The yaw and shift that lays the first of each pair over the second, least squares.
[[nodiscard]] Pose lay_over(std::span<const std::pair<Eigen::Vector3d, Eigen::Vector3d>> points);

/// Where W is cannot be measured: it is defined, by the mean place and heading of some tags (inner
/// constraints; Baarda, S-transformations and criterion matrices, 1973). Errors, which are on the
/// world's side, are then those against that mean:
///
///     ξ' = ξ − N (Bᵀ N)⁻¹ Bᵀ ξ,   N: a common shift and yaw;  Bᵀ ξ: the mean's shift and yaw
class Datum final {
 public:
  struct Tag {
    int variable{};
    Eigen::Vector3d p_WT;
  };
  /// @param defining  at least one; with a single one the heading is its own
  Datum(const std::vector<Tag>& defining, const std::vector<Pose>& poses,
        const BlockCholesky& factor, const BlockMatrix& matrix);

  /// Covariance between two variables of six numbers each, against the mean.
  /// @param raw  by whatever held the axes
  [[nodiscard]] Matrix6d between(int first, int second, const Matrix6d& raw) const;

  /// A variable, or some rows of it from its first on.
  struct Rows {
    int variable{};
    int size{};
    bool is_in_room{};  ///< Its first six are a pose in W.
  };
  /// The same of several at once, one after the other.
  [[nodiscard]] Eigen::MatrixXd of(std::span<const Rows> rows, const Eigen::MatrixXd& raw) const;

 private:
  using Common = Eigen::Matrix<double, 6, 4>;

  std::vector<int> first_;  ///< Row of each variable.
  Eigen::Matrix4d M_;
  Eigen::MatrixXd C_;  ///< Σ B
  Eigen::Matrix4d T_;  ///< Bᵀ Σ B
};

}  // namespace fiducap
