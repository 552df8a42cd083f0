#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace fiducap {

/// A symmetric matrix of blocks, most of them zero. Variable i owns `sizes[i]` rows.
class BlockMatrix final {
 public:
  using Column = std::map<int, Eigen::MatrixXd>;  ///< Blocks at and below the diagonal, by row.

  explicit BlockMatrix(const std::vector<int>& sizes);

  [[nodiscard]] int variables() const { return static_cast<int>(columns_.size()); }
  [[nodiscard]] int first(int variable) const { return first_[static_cast<std::size_t>(variable)]; }
  [[nodiscard]] int size(int variable) const { return first(variable + 1) - first(variable); }
  /// Rows of all variables.
  [[nodiscard]] int rows() const { return first_.back(); }

  /// Adds to the block of rows `row`, columns `column`, and its mirror image. A block on the
  /// diagonal is symmetric itself.
  void add(int row, int column, const Eigen::Ref<const Eigen::MatrixXd>& block);
  [[nodiscard]] const Column& column(int variable) const {
    return columns_[static_cast<std::size_t>(variable)];
  }

 private:
  std::vector<int> first_{0};
  std::vector<Column> columns_;
};

/// Cholesky factor P A Pᵀ = L Lᵀ of a BlockMatrix, ordered by approximate minimum degree (Amestoy,
/// Davis & Duff 1996), and those blocks of its inverse that the factor has a place for: covariances
/// of variables that are bound to each other directly, without the whole inverse (Takahashi et al.
/// 1973).
class BlockCholesky final {
 public:
  /// @param damping  is added to the diagonal, relative to it
  /// @return nullopt when the matrix is not positive definite
  [[nodiscard]] static std::optional<BlockCholesky> factor(const BlockMatrix& matrix,
                                                           double damping = 0);

  /// @param b  one or several right-hand sides
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;
  /// Pᵀ L⁻¹ P b: its square is bᵀ A⁻¹ b.
  [[nodiscard]] Eigen::MatrixXd half_solve(Eigen::MatrixXd b) const;
  /// Computes the blocks of the inverse.
  void invert();
  /// Block of the inverse; nullopt: the factor has no place for it. @pre invert()
  [[nodiscard]] std::optional<Eigen::MatrixXd> inverse(int row, int column) const;

 private:
  struct Rows {
    int first{};
    int size{};
  };

  BlockCholesky() = default;
  [[nodiscard]] bool eliminate(std::size_t k);
  [[nodiscard]] auto rows_of(std::size_t k, Eigen::MatrixXd& x) const {
    return x.middleRows(rows_[k].first, rows_[k].size);
  }

  std::vector<std::size_t> place_;            ///< Of each variable in the order of elimination.
  std::vector<Rows> rows_;                    ///< In that order: of the variable, …
  std::vector<BlockMatrix::Column> factor_;   ///< … and the columns of L, by place, …
  std::vector<BlockMatrix::Column> inverse_;  ///< … and of the inverse.
};

/// ∂ (rows of a term's error, from `at`) / ∂ variable.
struct TermPart {
  int variable{};
  int at{};
  Eigen::MatrixXd J;
};

/// Gauss–Newton about the present estimate, of a segment or of the map graph: H δ = pull, and the
/// cost there.
struct NormalEquations {
  explicit NormalEquations(const std::vector<int>& sizes)
      : H(sizes), pull(Eigen::VectorXd::Zero(H.rows())) {}
  /// A term, of second order in its error.
  void add(const std::vector<TermPart>& parts, const Eigen::MatrixXd& hessian,
           const Eigen::VectorXd& gradient);
  /// ½ eᵀ Λ e
  void add_square(const std::vector<TermPart>& parts, const Eigen::MatrixXd& information,
                  const Eigen::VectorXd& error);

  BlockMatrix H;
  Eigen::VectorXd pull;
  double cost{0};
};

/// Normal equations without their first variables: the Schur complement.
struct Reduced {
  Eigen::MatrixXd H;
  Eigen::VectorXd pull;
  double cost{};
  BlockCholesky factor;    ///< Of the first variables …
  Eigen::MatrixXd across;  ///< … and the rest by them.
};
/// @return nullopt: singular or not finite
[[nodiscard]] std::optional<Reduced> reduce(const NormalEquations& equations, int first_variables);

}  // namespace fiducap
