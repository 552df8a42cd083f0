#include "mapping/graph/block_cholesky.hpp"

#include <algorithm>
#include <iterator>
#include <set>

#include <Eigen/Cholesky>

#include "base/expected.hpp"

namespace fiducap {

namespace {

/// Which variables are bound to which: neighbours of each, ascending.
std::vector<std::vector<int>> neighbours_in(const BlockMatrix& matrix) {
  std::vector<std::vector<int>> out(static_cast<std::size_t>(matrix.variables()));
  for (const auto& [row, column] : matrix.places()) {
    if (row == column) continue;
    out[static_cast<std::size_t>(row)].push_back(column);
    out[static_cast<std::size_t>(column)].push_back(row);
  }
  for (auto& all : out) std::ranges::sort(all);
  return out;
}

/// Takes one variable after the other, that with the fewest rows beside it first. What is beside it
/// then is bound to each other.
class LeastDegree final {
 public:
  explicit LeastDegree(const BlockMatrix& matrix)
      : matrix_(matrix), beside_(neighbours_in(matrix)), degree_(beside_.size()) {
    for (int i = 0; i < matrix.variables(); ++i) queue_.emplace(count(i), i);
  }

  /// @return the next variable and what is beside it; @pre not all are taken
  std::pair<int, std::vector<int>> take() {
    const int variable = queue_.begin()->second;
    queue_.erase(queue_.begin());
    std::vector<int> beside = std::move(beside_[static_cast<std::size_t>(variable)]);
    for (const int i : beside) bind(i, variable, beside);
    return {variable, std::move(beside)};
  }

 private:
  int count(int variable) {
    int rows = 0;
    for (const int i : beside_[static_cast<std::size_t>(variable)]) rows += matrix_.size(i);
    degree_[static_cast<std::size_t>(variable)] = rows;
    return rows;
  }

  void bind(int variable, int gone, const std::vector<int>& others) {
    auto& own = beside_[static_cast<std::size_t>(variable)];
    std::vector<int> all;
    std::set_union(own.begin(), own.end(), others.begin(), others.end(), std::back_inserter(all));
    std::erase_if(all, [&](int i) { return i == gone || i == variable; });
    own = std::move(all);
    queue_.erase({degree_[static_cast<std::size_t>(variable)], variable});
    queue_.emplace(count(variable), variable);
  }

  const BlockMatrix& matrix_;
  std::vector<std::vector<int>> beside_;
  std::vector<int> degree_;
  std::set<std::pair<int, int>> queue_;
};

}  // namespace

BlockMatrix::BlockMatrix(std::vector<int> sizes) : sizes_(std::move(sizes)), first_(1, 0) {
  for (const int size : sizes_) first_.push_back(first_.back() + size);
}

void BlockMatrix::add(int row, int column, const Eigen::Ref<const Eigen::MatrixXd>& block) {
  if (row < column) return add(column, row, block.transpose());
  const auto [at, is_new] = numbers_.try_emplace(key(row, column), blocks_.size());
  if (is_new) {
    places_.emplace_back(row, column);
    blocks_.emplace_back(block);
  } else {
    blocks_[at->second] += block;
  }
}

const Eigen::MatrixXd* BlockMatrix::find(int row, int column) const {
  const auto at = numbers_.find(key(row, column));
  return at == numbers_.end() ? nullptr : &blocks_[at->second];
}

Eigen::VectorXd BlockMatrix::diagonal() const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(rows());
  for (int i = 0; i < variables(); ++i)
    if (const Eigen::MatrixXd* own = find(i, i)) out.segment(first(i), size(i)) = own->diagonal();
  return out;
}

std::optional<BlockCholesky> BlockCholesky::factor(const BlockMatrix& matrix, double damping) {
  BlockCholesky out;
  out.plan(matrix);
  out.fill(matrix, damping);
  if (!out.eliminate()) return std::nullopt;
  return out;
}

void BlockCholesky::plan(const BlockMatrix& matrix) {
  const auto count = static_cast<std::size_t>(matrix.variables());
  place_.resize(count);
  columns_.resize(count);
  LeastDegree order(matrix);
  for (std::size_t k = 0; k < count; ++k) {
    auto [variable, beside] = order.take();
    place_[static_cast<std::size_t>(variable)] = static_cast<int>(k);
    columns_[k].variable = variable;
    columns_[k].size = matrix.size(variable);
    columns_[k].below = std::move(beside);
    first_.push_back(matrix.first(static_cast<int>(k)));
  }
  for (Column& column : columns_) {
    for (int& i : column.below) i = place_[static_cast<std::size_t>(i)];
    std::ranges::sort(column.below);
    column.offset.assign(1, 0);
    for (const int i : column.below)
      column.offset.push_back(column.offset.back() + columns_[static_cast<std::size_t>(i)].size);
  }
}

void BlockCholesky::fill(const BlockMatrix& matrix, double damping) {
  for (Column& column : columns_) {
    column.own = Eigen::MatrixXd::Zero(column.size, column.size);
    column.panel = Eigen::MatrixXd::Zero(column.offset.back(), column.size);
  }
  for (const auto& [row, col] : matrix.places()) {
    const Eigen::MatrixXd& block = *matrix.find(row, col);
    const int at_row = place_[static_cast<std::size_t>(row)];
    const int at_col = place_[static_cast<std::size_t>(col)];
    Column& column = columns_[static_cast<std::size_t>(std::min(at_row, at_col))];
    if (at_row == at_col) {
      column.own += block;
      column.own.diagonal() += damping * block.diagonal();
      continue;
    }
    const auto found =
        std::lower_bound(column.below.begin(), column.below.end(), std::max(at_row, at_col));
    const int offset =
        column.offset[static_cast<std::size_t>(std::distance(column.below.begin(), found))];
    if (at_row > at_col) {
      column.panel.middleRows(offset, block.rows()) += block;
    } else {
      column.panel.middleRows(offset, block.cols()) += block.transpose();
    }
  }
}

bool BlockCholesky::eliminate() {
  for (Column& column : columns_) {
    const Eigen::LLT<Eigen::MatrixXd> own(column.own);
    if (own.info() != Eigen::Success) return false;
    column.own = own.matrixL();
    if (column.below.empty()) continue;
    column.own.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(
        column.panel);
    subtract_from_later(column);
  }
  return true;
}

/// What is eliminated binds what is below it: A_ij ← A_ij − L_i L_jᵀ.
void BlockCholesky::subtract_from_later(const Column& done) {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(done.panel.rows(), done.panel.rows());
  product.selfadjointView<Eigen::Lower>().rankUpdate(done.panel);
  for (std::size_t j = 0; j < done.below.size(); ++j) {
    Column& to = columns_[static_cast<std::size_t>(done.below[j])];
    const int from_column = done.offset[j];
    to.own.triangularView<Eigen::Lower>() -=
        product.block(from_column, from_column, to.size, to.size);
    std::size_t at = 0;
    for (std::size_t i = j + 1; i < done.below.size(); ++i) {
      while (to.below[at] != done.below[i]) ++at;
      const int rows = done.offset[i + 1] - done.offset[i];
      to.panel.middleRows(to.offset[at], rows) -=
          product.block(done.offset[i], from_column, rows, to.size);
    }
  }
}

Eigen::MatrixXd BlockCholesky::solve(const Eigen::MatrixXd& b) const {
  Eigen::MatrixXd x = b;
  const auto rows_of = [&](const Column& column) {
    return x.middleRows(first_[static_cast<std::size_t>(column.variable)], column.size);
  };
  for (const Column& column : columns_) {
    auto own = rows_of(column);
    column.own.triangularView<Eigen::Lower>().solveInPlace(own);
    for (std::size_t i = 0; i < column.below.size(); ++i) {
      const Column& below = columns_[static_cast<std::size_t>(column.below[i])];
      rows_of(below) -= column.panel.middleRows(column.offset[i], below.size) * own;
    }
  }
  for (auto column = columns_.rbegin(); column != columns_.rend(); ++column) {
    auto own = rows_of(*column);
    for (std::size_t i = 0; i < column->below.size(); ++i) {
      const Column& below = columns_[static_cast<std::size_t>(column->below[i])];
      own -= column->panel.middleRows(column->offset[i], below.size).transpose() * rows_of(below);
    }
    column->own.triangularView<Eigen::Lower>().transpose().solveInPlace(own);
  }
  return x;
}

/// The inverse among what is below `at`, all of which has a place.
void BlockCholesky::gather(const Column& at, const std::vector<Column>& inverse,
                           Eigen::MatrixXd& out) const {
  out.resize(at.panel.rows(), at.panel.rows());
  for (std::size_t j = 0; j < at.below.size(); ++j) {
    const Column& from = inverse[static_cast<std::size_t>(at.below[j])];
    out.block(at.offset[j], at.offset[j], from.size, from.size) = from.own;
    std::size_t place = 0;
    for (std::size_t i = j + 1; i < at.below.size(); ++i) {
      while (from.below[place] != at.below[i]) ++place;
      const int rows = at.offset[i + 1] - at.offset[i];
      const auto block = from.panel.middleRows(from.offset[place], rows);
      out.block(at.offset[i], at.offset[j], rows, from.size) = block;
      out.block(at.offset[j], at.offset[i], from.size, rows) = block.transpose();
    }
  }
}

void BlockCholesky::invert() {
  inverse_ = columns_;
  Eigen::MatrixXd below;
  for (std::size_t k = columns_.size(); k-- > 0;) {
    const Column& column = columns_[k];
    Column& out = inverse_[k];
    const auto L = column.own.triangularView<Eigen::Lower>();
    Eigen::MatrixXd root = Eigen::MatrixXd::Identity(column.size, column.size);
    L.solveInPlace(root);
    out.own = root.transpose() * root;
    if (column.below.empty()) continue;
    const Eigen::MatrixXd lead = column.panel * root;
    gather(column, inverse_, below);
    out.panel.noalias() = -(below.selfadjointView<Eigen::Lower>() * lead);
    out.own.noalias() -= lead.transpose() * out.panel;
  }
}

std::optional<Eigen::MatrixXd> BlockCholesky::inverse(int row, int column) const {
  FIDUCAP_ASSERT(!inverse_.empty());
  const int at_row = place_[static_cast<std::size_t>(row)];
  const int at_col = place_[static_cast<std::size_t>(column)];
  const Column& from = inverse_[static_cast<std::size_t>(std::min(at_row, at_col))];
  if (at_row == at_col) return from.own;
  const int wanted = std::max(at_row, at_col);
  const auto found = std::lower_bound(from.below.begin(), from.below.end(), wanted);
  if (found == from.below.end() || *found != wanted) return std::nullopt;
  const auto i = static_cast<std::size_t>(std::distance(from.below.begin(), found));
  const Eigen::MatrixXd block =
      from.panel.middleRows(from.offset[i], from.offset[i + 1] - from.offset[i]);
  return at_row > at_col ? block : Eigen::MatrixXd(block.transpose());
}

}  // namespace fiducap
