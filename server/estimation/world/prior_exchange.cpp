#include "estimation/world/calibration_monitor.hpp"

#include <Eigen/Cholesky>

namespace fiducap::world {

namespace {
// Held tags may have only a common error.
constexpr double kRelativeRounding = 1e-9;

/// A column of the covariance in two parts.
struct Column {
  Eigen::VectorXd given_held;  ///< Conditional on the held tags; theirs: zero.
  Eigen::VectorXd by_held;     ///< By the uncertainty of the held tags.
};

Column column_of(const FilterState& state, int column) {
  const auto P = state.P();
  Column out{P.col(column), Eigen::VectorXd::Zero(P.rows())};
  std::vector<int> held;
  for (const int at : state.held_tags())
    for (int i = 0; i < layout::kPoseSize; ++i) held.push_back(at + i);
  if (held.empty()) return out;
  Eigen::MatrixXd of_held = P(held, held);
  of_held.diagonal() *= 1 + kRelativeRounding;
  const Eigen::VectorXd share = of_held.ldlt().solve(out.given_held(held));
  out.by_held = P(Eigen::all, held) * share;
  out.by_held(held) = out.given_held(held);
  out.given_held -= out.by_held;
  return out;
}
}  // namespace

double information_of(const FilterState& state, int column, double prior_sigma) {
  const double variance = state.P()(column, column);
  return variance > 0 ? 1 / variance - 1 / (prior_sigma * prior_sigma) : 0.0;
}

void exchange_prior(FilterState& state, int camera, int column, double value, double from_sigma,
                    double to_sigma) {
  const double gained = 1 / (to_sigma * to_sigma) - 1 / (from_sigma * from_sigma);
  const Column of = column_of(state, column);
  const double S = 1 + gained * of.given_held(column);
  if (!(S > 1e-9)) return;
  const double factor = gained / S;
  const double by_held = of.by_held(column);
  auto P = state.P();
  for (Eigen::Index k = 0; k < P.cols(); ++k) {
    const double own = factor * (1 - factor * by_held) * of.given_held(k) + factor * of.by_held(k);
    P.col(k) -= own * of.given_held + factor * of.given_held(k) * of.by_held;
  }
  const Eigen::VectorXd correction = -factor * value * of.given_held;
  state.add_error(correction);
  transport_covariance(state, correction, camera);
}

void widen(FilterState& state, int column, double sigma, const std::vector<int>& closed) {
  auto P = state.P();
  const double variance = P(column, column);
  if (!(variance > 0) || sigma * sigma <= variance) return;
  const Column of = column_of(state, column);
  if (!(of.given_held(column) > 0)) return;
  Eigen::VectorXd along = of.given_held / of.given_held(column);
  for (const int other : closed) along(other) = 0;
  P += (sigma * sigma - variance) * along * along.transpose();
}

}  // namespace fiducap::world
