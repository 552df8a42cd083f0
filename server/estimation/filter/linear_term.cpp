#include "estimation/filter/linear_term.hpp"

namespace fiducap {

void redefine(GrowingCovariance& covariance, int first, int second,
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
