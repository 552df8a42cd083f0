#pragma once

#include <span>

#include <Eigen/Cholesky>
#include <Eigen/Core>

/// The last two steps of a Kalman update in square-root form, whatever was measured. Nothing here
/// allocates.
namespace fiducap::kalman {

/// @param PHt   in: P Hᵀ, n × m; out: the square-root gain K S^{1/2}
/// @param S     in: H P Hᵀ + R; out: its Cholesky factor
/// @param y     in: the innovation; out: the same, whitened
/// @param held  first columns of six-wide blocks that must not learn (Schmidt's consider states)
/// @param dx    out: the correction, n
/// @return normalised innovation squared yᵀ S⁻¹ y
template <class Gain, class Innovation, class Scatter, class Correction>
double solve(Gain&& PHt, Scatter&& S, Innovation&& y, std::span<const int> held, Correction&& dx) {
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);  // in place: S becomes its Cholesky factor
  llt.matrixL().solveInPlace(y);
  llt.matrixU().template solveInPlace<Eigen::OnTheRight>(PHt);
  dx.noalias() = PHt * y;
  for (const int at : held) dx.template segment<6>(at).setZero();
  return y.squaredNorm();
}

/// P ← P − K S Kᵀ: symmetric by construction. What held blocks know of each other stays; their
/// correlation with the rest follows, so that their uncertainty is neither forgotten nor counted
/// twice.
/// @param gain  what solve() made of PHt
template <class Covariance, class Gain>
void shrink(Covariance&& P, const Gain& gain, std::span<const int> held) {
  P.template selfadjointView<Eigen::Lower>().rankUpdate(gain, -1.0);
  for (const int a : held) {
    for (const int b : held) {
      if (b <= a)
        P.template block<6, 6>(a, b).noalias() +=
            gain.template middleRows<6>(a) * gain.template middleRows<6>(b).transpose();
    }
  }
  P.template triangularView<Eigen::StrictlyUpper>() = P.transpose();
}

}  // namespace fiducap::kalman
