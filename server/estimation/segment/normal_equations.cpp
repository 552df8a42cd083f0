#include "estimation/segment/normal_equations.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

#include "base/expected.hpp"

namespace fiducap {

namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

/// Variables in the order of their elimination.
Eigen::VectorXi order_of(const BlockMatrix& matrix) {
  if (matrix.variables() == 0) return {};
  std::vector<Eigen::Triplet<double>> blocks;
  for (int column = 0; column < matrix.variables(); ++column)
    for (const auto& [row, block] : matrix.column(column)) blocks.emplace_back(row, column, 1.0);
  Eigen::SparseMatrix<double> pattern(matrix.variables(), matrix.variables());
  pattern.setFromTriplets(blocks.begin(), blocks.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern, order);
  return order.indices();
}

}  // namespace

BlockMatrix::BlockMatrix(const std::vector<int>& sizes) : columns_(sizes.size()) {
  for (const int size : sizes) first_.push_back(first_.back() + size);
}

void BlockMatrix::add(int row, int column, const Eigen::Ref<const Eigen::MatrixXd>& block) {
  if (row < column) return add(column, row, block.transpose());
  const auto [at, is_new] = columns_[index(column)].try_emplace(row, block);
  if (!is_new) at->second += block;
}

std::optional<BlockCholesky> BlockCholesky::factor(const BlockMatrix& matrix, double damping) {
  const Eigen::VectorXi order = order_of(matrix);
  BlockCholesky out;
  out.place_.resize(index(matrix.variables()));
  out.factor_.resize(out.place_.size());
  for (std::size_t k = 0; k < out.place_.size(); ++k) {
    const int variable = order(static_cast<Eigen::Index>(k));
    out.place_[index(variable)] = k;
    out.rows_.push_back({matrix.first(variable), matrix.size(variable)});
  }
  for (int column = 0; column < matrix.variables(); ++column) {
    for (const auto& [row, block] : matrix.column(column)) {
      const std::size_t i = out.place_[index(row)];
      const std::size_t j = out.place_[index(column)];
      Eigen::MatrixXd& to = out.factor_[std::min(i, j)][static_cast<int>(std::max(i, j))];
      to = block;
      if (i < j) to = block.transpose();
      if (i == j) to.diagonal() *= 1 + damping;
    }
  }
  for (std::size_t k = 0; k < out.factor_.size(); ++k)
    if (!out.eliminate(k)) return std::nullopt;
  return out;
}

/// What is eliminated binds what is below it: A_ij ← A_ij − L_ik L_jkᵀ.
bool BlockCholesky::eliminate(std::size_t k) {
  BlockMatrix::Column& column = factor_[k];
  if (column.empty() || column.begin()->first != static_cast<int>(k)) return false;
  Eigen::MatrixXd& own = column.begin()->second;
  const Eigen::LLT<Eigen::MatrixXd> llt(own);
  if (llt.info() != Eigen::Success) return false;
  own = llt.matrixL();
  const auto first = std::next(column.begin());
  for (auto i = first; i != column.end(); ++i)
    own.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(i->second);
  for (auto j = first; j != column.end(); ++j) {
    BlockMatrix::Column& to = factor_[index(j->first)];
    auto at = to.begin();
    for (auto i = j; i != column.end(); ++i) {
      at = to.try_emplace(at, i->first);
      if (at->second.size() == 0) at->second.setZero(i->second.rows(), j->second.rows());
      at->second.noalias() -= i->second * j->second.transpose();
    }
  }
  return true;
}

Eigen::MatrixXd BlockCholesky::half_solve(Eigen::MatrixXd b) const {
  for (std::size_t k = 0; k < factor_.size(); ++k) {
    auto own = rows_of(k, b);
    factor_[k].begin()->second.triangularView<Eigen::Lower>().solveInPlace(own);
    for (auto i = std::next(factor_[k].begin()); i != factor_[k].end(); ++i)
      rows_of(index(i->first), b).noalias() -= i->second * own;
  }
  return b;
}

Eigen::MatrixXd BlockCholesky::solve(const Eigen::MatrixXd& b) const {
  Eigen::MatrixXd x = half_solve(b);
  for (std::size_t k = factor_.size(); k-- > 0;) {
    auto own = rows_of(k, x);
    for (auto i = std::next(factor_[k].begin()); i != factor_[k].end(); ++i)
      own.noalias() -= i->second.transpose() * rows_of(index(i->first), x);
    factor_[k].begin()->second.triangularView<Eigen::Lower>().transpose().solveInPlace(own);
  }
  return x;
}

/// Z_ik = −Σ_j Z_ij L_jk L_kk⁻¹ and Z_kk = L_kk⁻ᵀ L_kk⁻¹ − Σ_i (L_ik L_kk⁻¹)ᵀ Z_ik: what is below k
/// has a place in the columns after it.
void BlockCholesky::invert() {
  inverse_ = factor_;
  for (std::size_t k = factor_.size(); k-- > 0;) {
    const auto first = std::next(factor_[k].begin());
    Eigen::Index rows = 0;
    for (auto j = first; j != factor_[k].end(); ++j) rows += j->second.rows();
    Eigen::MatrixXd lead(rows, rows_[k].size);
    Eigen::MatrixXd below(rows, rows);  // of Z, lower triangle
    Eigen::Index column = 0;
    for (auto j = first; j != factor_[k].end(); ++j) {
      lead.middleRows(column, j->second.rows()) = j->second;
      auto from = inverse_[index(j->first)].begin();
      Eigen::Index row = column;
      for (auto i = j; i != factor_[k].end(); ++i) {
        while (from->first != i->first) ++from;
        below.block(row, column, i->second.rows(), j->second.rows()) = from->second;
        row += i->second.rows();
      }
      column += j->second.rows();
    }
    Eigen::MatrixXd root = Eigen::MatrixXd::Identity(rows_[k].size, rows_[k].size);
    factor_[k].begin()->second.triangularView<Eigen::Lower>().solveInPlace(root);
    lead = (lead * root).eval();
    const Eigen::MatrixXd found = below.selfadjointView<Eigen::Lower>() * lead;
    Eigen::Index row = 0;
    for (auto i = std::next(inverse_[k].begin()); i != inverse_[k].end(); ++i) {
      i->second = -found.middleRows(row, i->second.rows());
      row += i->second.rows();
    }
    inverse_[k].begin()->second = root.transpose() * root + lead.transpose() * found;
  }
}

std::optional<Eigen::MatrixXd> BlockCholesky::inverse(int row, int column) const {
  FIDUCAP_ASSERT(!inverse_.empty());
  const std::size_t i = place_[index(row)];
  const std::size_t j = place_[index(column)];
  const BlockMatrix::Column& from = inverse_[std::min(i, j)];
  const auto found = from.find(static_cast<int>(std::max(i, j)));
  if (found == from.end()) return std::nullopt;
  return i >= j ? found->second : Eigen::MatrixXd(found->second.transpose());
}

void NormalEquations::add(const std::vector<TermPart>& parts, const Eigen::MatrixXd& hessian,
                          const Eigen::VectorXd& gradient) {
  for (const TermPart& a : parts) {
    const Eigen::Index rows = a.J.rows();
    pull.segment(H.first(a.variable), a.J.cols()) -= a.J.transpose() * gradient.segment(a.at, rows);
    const Eigen::MatrixXd left = a.J.transpose() * hessian.middleRows(a.at, rows);
    for (const TermPart& b : parts)
      if (b.variable <= a.variable)
        H.add(a.variable, b.variable, left.middleCols(b.at, b.J.rows()) * b.J);
  }
}

void NormalEquations::add_square(const std::vector<TermPart>& parts,
                                 const Eigen::MatrixXd& information, const Eigen::VectorXd& error) {
  const Eigen::VectorXd gradient = information * error;
  cost += 0.5 * error.dot(gradient);
  add(parts, information, gradient);
}

/// H_rr − H_rf H_ff⁻¹ H_fr and η_r − H_rf H_ff⁻¹ η_f, by L⁻¹ of H_ff.
std::optional<Reduced> reduce(const NormalEquations& equations, int first_variables) {
  const BlockMatrix& all = equations.H;
  std::vector<int> sizes;
  for (int i = 0; i < first_variables; ++i) sizes.push_back(all.size(i));
  BlockMatrix first(sizes);
  const Eigen::Index rest = all.rows() - first.rows();
  Eigen::MatrixXd across = Eigen::MatrixXd::Zero(rest, first.rows());
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(rest, rest);
  for (int column = 0; column < all.variables(); ++column) {
    for (const auto& [row, block] : all.column(column)) {
      const int at = all.first(row) - first.rows();
      const int from = all.first(column);
      if (at < 0) {
        first.add(row, column, block);
      } else if (from < first.rows()) {
        across.block(at, from, block.rows(), block.cols()) = block;
      } else {
        H.block(at, from - first.rows(), block.rows(), block.cols()) = block;
      }
    }
  }
  auto factor = BlockCholesky::factor(first);
  if (!factor) return std::nullopt;
  Eigen::VectorXd pull = equations.pull.tail(rest);
  double cost = equations.cost;
  if (first_variables > 0) {
    const Eigen::MatrixXd by = factor->half_solve(across.transpose());
    const Eigen::VectorXd own = factor->half_solve(equations.pull.head(first.rows()));
    H.selfadjointView<Eigen::Lower>().rankUpdate(by.transpose(), -1.0);
    pull -= by.transpose() * own;
    cost -= 0.5 * own.squaredNorm();
  }
  H.triangularView<Eigen::StrictlyUpper>() = H.transpose();
  if (!H.allFinite() || !pull.allFinite() || !std::isfinite(cost)) return std::nullopt;
  return Reduced{std::move(H), std::move(pull), cost, std::move(*factor), std::move(across)};
}

}  // namespace fiducap
