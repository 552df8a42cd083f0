#include "estimation/world/state_prior.hpp"

#include <Eigen/Cholesky>

namespace fiducap::world {

namespace {
// Held tags may have only a common error.
constexpr double kRelativeRounding = 1e-9;

/// A covariance of the state with one number, in two parts.
struct Column {
  Eigen::VectorXd given_held;  ///< Conditional on the held tags; theirs: zero.
  Eigen::VectorXd by_held;     ///< By the uncertainty of the held tags.
};

/// @param l  derivative of the number by the state
Column split(const FilterState& state, const Eigen::VectorXd& l) {
  const auto P = state.P();
  Column out{P * l, Eigen::VectorXd::Zero(P.rows())};
  std::vector<int> held;
  for (const int at : state.held_tags())
    for (int i = 0; i < layout::kPoseSize; ++i) held.push_back(at + i);
  if (held.empty()) return out;
  const auto count = static_cast<Eigen::Index>(held.size());
  Eigen::MatrixXd with_held(P.rows(), count);
  for (Eigen::Index i = 0; i < count; ++i) with_held.col(i) = P.col(held[i]);
  Eigen::MatrixXd of_held(count, count);
  Eigen::VectorXd given(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    of_held.row(i) = with_held.row(held[i]);
    given[i] = out.given_held(held[i]);
  }
  of_held.diagonal() *= 1 + kRelativeRounding;
  out.by_held = with_held * of_held.ldlt().solve(given);
  for (Eigen::Index i = 0; i < count; ++i) out.by_held[held[i]] = given[i];
  out.given_held -= out.by_held;
  return out;
}
}  // namespace

void exchange_prior(FilterState& state, int camera, const Eigen::VectorXd& l, double value,
                    double from_sigma, double to_sigma) {
  const double gained = 1 / (to_sigma * to_sigma) - 1 / (from_sigma * from_sigma);
  const Column of = split(state, l);
  const double S = 1 + gained * l.dot(of.given_held);
  if (!(S > 1e-9)) return;
  const double factor = gained / S;
  const double by_held = l.dot(of.by_held);
  auto P = state.P();
  for (Eigen::Index k = 0; k < P.cols(); ++k) {
    const double own = factor * (1 - factor * by_held) * of.given_held(k) + factor * of.by_held(k);
    P.col(k) -= own * of.given_held + factor * of.given_held(k) * of.by_held;
  }
  const Eigen::VectorXd correction = -factor * value * of.given_held;
  state.add_error(correction);
  transport_covariance(state, correction, camera);
}

void widen(FilterState& state, const Eigen::VectorXd& l, double sigma, const Closed& closed) {
  const Column of = split(state, l);
  const double given = l.dot(of.given_held);
  const double variance = given + l.dot(of.by_held);
  if (!(given > 0) || sigma * sigma <= variance) return;
  Eigen::VectorXd along = of.given_held / given;
  for (const int column : closed.columns) along(column) = 0;
  for (const int camera : closed.mounts)
    along.segment<6>(layout::camera(camera)) = along.head<6>().eval();
  auto P = state.P();
  P += (sigma * sigma - variance) * along * along.transpose();
}

}  // namespace fiducap::world
