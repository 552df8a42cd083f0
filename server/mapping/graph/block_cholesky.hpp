#pragma once

#include <cstdint>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace fiducap {

/// A symmetric matrix of blocks, most of them zero: the normal equations of a map graph. Variable i
/// owns `sizes[i]` rows.
class BlockMatrix final {
 public:
  explicit BlockMatrix(std::vector<int> sizes);

  [[nodiscard]] int variables() const { return static_cast<int>(sizes_.size()); }
  [[nodiscard]] int size(int variable) const { return sizes_[static_cast<std::size_t>(variable)]; }
  [[nodiscard]] int first(int variable) const { return first_[static_cast<std::size_t>(variable)]; }
  /// Rows of all variables.
  [[nodiscard]] int rows() const { return first_.back(); }

  /// Adds to the block of rows `row`, columns `column`, and its mirror image. A block on the
  /// diagonal is symmetric itself.
  void add(int row, int column, const Eigen::Ref<const Eigen::MatrixXd>& block);
  [[nodiscard]] Eigen::VectorXd diagonal() const;
  /// The block at or below the diagonal, or nullptr when it is zero. @pre row >= column
  [[nodiscard]] const Eigen::MatrixXd* find(int row, int column) const;
  /// Blocks at or below the diagonal, as (row, column).
  [[nodiscard]] const std::vector<std::pair<int, int>>& places() const { return places_; }

 private:
  [[nodiscard]] std::uint64_t key(int row, int column) const {
    return static_cast<std::uint64_t>(row) * sizes_.size() + static_cast<std::uint64_t>(column);
  }

  std::vector<int> sizes_;
  std::vector<int> first_;
  std::unordered_map<std::uint64_t, std::size_t> numbers_;
  std::vector<std::pair<int, int>> places_;
  std::vector<Eigen::MatrixXd> blocks_;
};

/// Cholesky factor of a BlockMatrix, least-degree order (Tinney & Walker 1967), and those blocks of
/// its inverse that the factor has a place for: covariances of variables that are bound to each
/// other directly, without the whole inverse (Takahashi et al. 1973).
class BlockCholesky final {
 public:
  /// @param damping  is added to the diagonal, relative to it
  /// @return nullopt when the matrix is not positive definite
  [[nodiscard]] static std::optional<BlockCholesky> factor(const BlockMatrix& matrix,
                                                           double damping = 0);

  /// @param b  one or several right-hand sides
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;
  /// Works out the blocks of the inverse.
  void invert();
  /// Block of the inverse; nullopt: the factor has no place for it. @pre invert()
  [[nodiscard]] std::optional<Eigen::MatrixXd> inverse(int row, int column) const;

 private:
  struct Column {
    int variable{};
    int size{};
    std::vector<int> below;   ///< Places in the order, ascending, of blocks below the diagonal …
    std::vector<int> offset;  ///< … and where each begins in `panel`; one more: the end.
    Eigen::MatrixXd own;      ///< Lower triangle of the diagonal block; of the inverse: all of it.
    Eigen::MatrixXd panel;
  };

  BlockCholesky() = default;
  void plan(const BlockMatrix& matrix);
  void fill(const BlockMatrix& matrix, double damping);
  [[nodiscard]] bool eliminate();
  void subtract_from_later(const Column& done);
  void gather(const Column& at, const std::vector<Column>& inverse, Eigen::MatrixXd& out) const;

  std::vector<Column> columns_;  ///< In the order of elimination.
  std::vector<int> place_;       ///< Of each variable in that order.
  std::vector<int> first_;       ///< Of each variable, in the whole.
  std::vector<Column> inverse_;
};

}  // namespace fiducap
