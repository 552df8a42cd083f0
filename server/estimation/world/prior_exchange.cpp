#include "estimation/world/prior_exchange.hpp"

#include <algorithm>

namespace fiducap::world {

double information_of(const FilterState& state, int column, double prior_sigma) {
  const double variance = state.P()(column, column);
  return variance > 0 ? 1 / variance - 1 / (prior_sigma * prior_sigma) : 0.0;
}

void exchange_prior(FilterState& state, int camera, int column, double value, double from_sigma,
                    double to_sigma) {
  const double gained = 1 / (to_sigma * to_sigma) - 1 / (from_sigma * from_sigma);
  auto P = state.P();
  const double S = 1 + gained * P(column, column);
  if (!(S > 1e-9)) return;
  Eigen::VectorXd p = P.col(column);
  if (gained < 0) {
    // What held tags know of each other stays, so what grows must not reach them: else the whole
    // would be no covariance.
    for (const int at : state.held_tags()) p.segment<6>(at).setZero();
  }
  std::vector<bool> is_held(static_cast<std::size_t>(P.rows()), false);
  for (const int at : state.held_tags()) std::fill_n(is_held.begin() + at, 6, true);
  const double factor = gained / S;
  for (Eigen::Index k = 0; k < P.cols(); ++k) {
    for (Eigen::Index i = 0; i < P.rows(); ++i) {
      const bool both =
          is_held[static_cast<std::size_t>(i)] && is_held[static_cast<std::size_t>(k)];
      if (!both) P(i, k) -= factor * p(i) * p(k);
    }
  }
  Eigen::VectorXd correction = -factor * value * p;
  for (const int at : state.held_tags()) correction.segment<6>(at).setZero();
  state.add_error(correction);
  transport_covariance(state, correction, camera);
}

void widen(FilterState& state, int column, double sigma, const std::vector<int>& closed) {
  auto P = state.P();
  const double variance = P(column, column);
  if (!(variance > 0) || sigma * sigma <= variance) return;
  Eigen::VectorXd along = P.col(column) / variance;
  for (const int at : state.held_tags()) along.segment<6>(at).setZero();
  for (const int other : closed) along(other) = 0;
  P += (sigma * sigma - variance) * along * along.transpose();
}

}  // namespace fiducap::world
