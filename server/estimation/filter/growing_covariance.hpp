#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <span>

#include "estimation/known_tag.hpp"

namespace fiducap {

/// Covariance of a state whose tail grows and shrinks by six numbers per tag. Keeps its memory: a
/// state of constant size allocates nothing.
class GrowingCovariance final {
 public:
  /// All zero, n × n.
  void reset(int n) {
    size_ = n;
    memory_ = Eigen::MatrixXd::Zero(n, n);
  }

  [[nodiscard]] int size() const { return size_; }
  /// The live part: symmetric.
  [[nodiscard]] auto live() { return memory_.topLeftCorner(size_, size_); }
  [[nodiscard]] auto live() const { return memory_.topLeftCorner(size_, size_); }

  /// Six rows as wide as the state, content undefined.
  [[nodiscard]] auto six_rows() {
    if (six_rows_.cols() < size_) six_rows_.resize(6, memory_.cols());
    return six_rows_.leftCols(size_);
  }

  /// Six more numbers at the end, uncorrelated with the rest.
  void append(const Matrix6d& own) {
    const int at = size_;
    size_ += 6;
    if (size_ > memory_.rows()) {
      // Grows by half: a growing map is not copied for each tag.
      const Eigen::Index room = std::max<Eigen::Index>(size_, memory_.rows() * 3 / 2);
      Eigen::MatrixXd larger = Eigen::MatrixXd::Zero(room, room);
      larger.topLeftCorner(at, at) = memory_.topLeftCorner(at, at);
      memory_.swap(larger);
    }
    memory_.block(at, 0, 6, size_).setZero();
    memory_.block(0, at, size_, 6).setZero();
    memory_.block<6, 6>(at, at) = own;
  }

  /// Marginalises blocks of six numbers. @param at  their first rows, ascending
  void erase(std::span<const int> at) {
    int kept = 0;
    std::size_t erased = 0;
    for (int k = 0; k < size_; ++k) {
      if (erased < at.size() && k == at[erased]) {
        ++erased;
        k += 5;
        continue;
      }
      copy_kept(memory_.col(k).data(), memory_.col(kept++).data(), at);
    }
    size_ = kept;
  }

 private:
  void copy_kept(const double* from, double* to, std::span<const int> at) const {
    int begin = 0;
    const auto copy_until = [&](int end) {
      to = to == from + begin ? to + (end - begin) : std::copy(from + begin, from + end, to);
      begin = end + 6;
    };
    for (const int gap : at) copy_until(gap);
    copy_until(size_);
  }

  int size_{0};
  Eigen::MatrixXd memory_;
  Eigen::Matrix<double, 6, Eigen::Dynamic> six_rows_;
};

/// One term of a linear function: derivative of six numbers by the three-wide block at `at`.
struct LinearTerm {
  int at{};
  Eigen::Matrix<double, 6, 3> J;
};

/// Replaces two three-wide blocks of the state by a linear function of the present state plus
/// independent noise: (x_first, x_second) ← Σ J x_at + n. The covariance follows exactly.
inline void redefine(GrowingCovariance& covariance, int first, int second,
                     std::span<const LinearTerm> terms, const Matrix6d& noise) {
  auto P = covariance.live();
  auto rows = covariance.six_rows();
  rows.setZero();
  for (const LinearTerm& term : terms) rows.noalias() += term.J * P.middleRows<3>(term.at);
  Matrix6d self = noise;
  for (const LinearTerm& term : terms)
    self.noalias() += rows.middleCols<3>(term.at) * term.J.transpose();
  rows.middleCols<3>(first) = self.leftCols<3>();
  rows.middleCols<3>(second) = self.rightCols<3>();
  P.middleRows<3>(first) = rows.topRows<3>();
  P.middleRows<3>(second) = rows.bottomRows<3>();
  P.middleCols<3>(first) = rows.topRows<3>().transpose();
  P.middleCols<3>(second) = rows.bottomRows<3>().transpose();
}

}  // namespace fiducap
