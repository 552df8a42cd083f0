#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <span>
#include <vector>

#include "estimation/filter/dense_kernels.hpp"

/// Gain, correction and covariance of a Kalman update in square-root form. Nothing here allocates.
namespace fiducap::kalman {

template <class Block>
[[nodiscard]] dense::View view_of(Block& block) {
  return {block.data(), block.outerStride()};
}

/// @param PHt   in: P Hᵀ, n × m; out: the square-root gain K S^{1/2}
/// @param S     in: H P Hᵀ + R, lower triangle; out: its Cholesky factor
/// @param y     in: the innovation; out: whitened
/// @param held  first columns of six-wide blocks that are not corrected (Schmidt's consider states)
/// @param dx    out: the correction, n
/// @return normalised innovation squared yᵀ S⁻¹ y
template <class Gain, class Innovation, class Scatter, class Correction>
double solve(Gain&& PHt, Scatter&& S, Innovation&& y, std::span<const int> held, Correction&& dx) {
  const dense::Index m = y.size();
  dense::factor(view_of(S), m);
  dense::divide(view_of(S), m, {y.data(), 1}, 1);  // a row as long as S is wide
  dense::divide(view_of(S), m, view_of(PHt), PHt.rows());
  dx.noalias() = PHt * y;
  for (const int at : held) dx.template segment<6>(at).setZero();
  return y.squaredNorm();
}

/// P ← P − K S Kᵀ, symmetric by construction. The covariance among held blocks is not changed;
/// their correlation with the rest is (Schmidt).
/// @param gain  PHt after solve()
/// @param mask  scratch memory, kept between updates
template <class Covariance, class Gain>
void shrink(Covariance&& P, const Gain& gain, std::span<const int> held,
            std::vector<unsigned char>& mask) {
  mask.assign(held.empty() ? 0 : static_cast<std::size_t>(P.rows()), 0);
  for (const int at : held) std::fill_n(mask.begin() + at, 6, 1);
  dense::subtract_square(view_of(P), P.rows(), {gain.data(), gain.outerStride()}, gain.cols(),
                         mask);
}

}  // namespace fiducap::kalman
