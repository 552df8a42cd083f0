#include "estimation/world/state_prior.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace fiducap::world {

namespace {
// Held tags may have only a common error.
constexpr double kRelativeRounding = 1e-9;

/// Covariance of the state with some numbers, in two parts.
struct Columns {
  Eigen::MatrixXd given_held;  ///< Conditional on the held tags; theirs: zero.
  Eigen::MatrixXd by_held;     ///< By the uncertainty of the held tags.
};

/// @param L  derivative of the numbers by the state, transposed
Columns split(const FilterState& state, const Eigen::MatrixXd& L) {
  const auto P = state.P();
  Columns out{P * L, Eigen::MatrixXd::Zero(P.rows(), L.cols())};
  std::vector<int> held;
  for (const int at : state.held_tags())
    for (int i = 0; i < layout::kPoseSize; ++i) held.push_back(at + i);
  if (held.empty()) return out;
  const auto count = static_cast<Eigen::Index>(held.size());
  Eigen::MatrixXd with_held(P.rows(), count);
  for (Eigen::Index i = 0; i < count; ++i) with_held.col(i) = P.col(held[i]);
  Eigen::MatrixXd of_held(count, count);
  Eigen::MatrixXd given(count, L.cols());
  for (Eigen::Index i = 0; i < count; ++i) {
    of_held.row(i) = with_held.row(held[i]);
    given.row(i) = out.given_held.row(held[i]);
  }
  of_held.diagonal() *= 1 + kRelativeRounding;
  out.by_held = with_held * of_held.ldlt().solve(given);
  for (Eigen::Index i = 0; i < count; ++i) out.by_held.row(held[i]) = given.row(i);
  out.given_held -= out.by_held;
  return out;
}

/// (C + (D'⁻¹ − D⁻¹)⁻¹)⁻¹ of numbers with covariance C when their priors become D' instead of D.
Eigen::MatrixXd gain_of_priors(const Eigen::MatrixXd& C, const Eigen::VectorXd& from_sigmas,
                               const Eigen::VectorXd& to_sigmas) {
  // In units of D, of which no direction can be more uncertain.
  const Eigen::VectorXd unit = from_sigmas.cwiseInverse();
  const Eigen::MatrixXd A = unit.asDiagonal() * C * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (A + A.transpose()));
  Eigen::MatrixXd S = eigen.eigenvectors() * eigen.eigenvalues().cwiseMin(1.0).asDiagonal() *
                      eigen.eigenvectors().transpose();
  for (Eigen::Index i = 0; i < S.rows(); ++i) {
    const double ratio = from_sigmas(i) / to_sigmas(i);
    S(i, i) += 1 / (ratio * ratio - 1);
  }
  const Eigen::MatrixXd inverse = S.inverse();
  return unit.asDiagonal() * (0.5 * (inverse + inverse.transpose())).eval() * unit.asDiagonal();
}
}  // namespace

void exchange_priors(FilterState& state, int camera, const Numbers& numbers,
                     const Eigen::VectorXd& from_sigmas, const Eigen::VectorXd& to_sigmas) {
  const Columns of = split(state, numbers.L);
  // The gain moves what is conditional on the held tags by the whole error of the numbers.
  const Eigen::MatrixXd K =
      of.given_held * gain_of_priors(numbers.L.transpose() * of.given_held, from_sigmas, to_sigmas);
  const Eigen::MatrixXd by_held =
      of.by_held - 0.5 * K * (numbers.L.transpose() * of.by_held).transpose();
  auto P = state.P();
  P -= K * (of.given_held + by_held).transpose() + by_held * K.transpose();
  P = (0.5 * (P + P.transpose())).eval();
  const Eigen::VectorXd correction = -K * numbers.values;
  state.add_error(correction);
  transport_covariance(state, correction, camera);
}

void widen(FilterState& state, const Eigen::VectorXd& l, double sigma, const Closed& closed) {
  const Columns of = split(state, l);
  const double given = l.dot(of.given_held.col(0));
  const double variance = given + l.dot(of.by_held.col(0));
  if (!(given > 0) || sigma * sigma <= variance) return;
  Eigen::VectorXd along = of.given_held.col(0) / given;
  for (const int column : closed.columns) along(column) = 0;
  for (const int camera : closed.mounts)
    along.segment<6>(layout::camera(camera)) = along.head<6>().eval();
  auto P = state.P();
  P += (sigma * sigma - variance) * along * along.transpose();
}

}  // namespace fiducap::world
