// CalibrationMonitor: likelihood of the parameters, and which of them explain the data.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimation/world/calibration_monitor.hpp"

namespace fiducap::world {

namespace {
// Log evidence that a first group must add, and each further one. A group that explains the data
// less well than the best one by a factor of 150 at most, and better than none by a factor of 7,
// explains them as well.
constexpr double kNeedsOne = 5.0;
constexpr double kNeedsBoth = 8.0;
constexpr double kAsGood = 5.0;
constexpr double kBetterThanNone = 2.0;
// Smallest variance in units of the prior: that of an open size is 1e-5.
constexpr double kSmallest = 1e-12;
// Prior probability that a group of parameters differs from the configuration by its wide prior.
constexpr double kWrong = 0.001;
constexpr double kMostLogOdds = 40.0;  // a probability of one, in double precision
}  // namespace

/// Of the common parameters, of those of `camera`, and of the next cameras while there is room; the
/// others have their present priors.
CalibrationMonitor::Likelihood CalibrationMonitor::likelihood(const FilterState& state, int camera,
                                                              double dispersion) const {
  Likelihood out;
  const auto take_rows_of = [&](int of_camera) {
    const std::size_t before = out.count;
    for (std::size_t i = 0; i < all_.size(); ++i) {
      const bool is_free = all_[i].print >= 0 && watched_tag(state, all_[i]) < 0;
      const bool is_tested = !all_[i].is_refined && all_[i].assumed_sigma == 0 && !is_free;
      if (all_[i].camera != of_camera || !is_tested) continue;
      if (out.count < kMostRows) {
        out.rows[out.count++] = i;
      } else {
        out.count = before;
        return;
      }
    }
  };
  take_rows_of(-1);
  for (int k = 0; k < state.cameras(); ++k) take_rows_of((camera + k) % state.cameras());
  const auto k = static_cast<Eigen::Index>(out.count);
  RowMatrix P(k, k);
  RowVector offsets(k);
  RowVector unit(k);
  for (Eigen::Index a = 0; a < k; ++a) {
    const std::size_t i = out.rows[static_cast<std::size_t>(a)];
    for (Eigen::Index b = 0; b <= a; ++b)
      P(a, b) = P(b, a) = covariance(state, all_[i], all_[out.rows[static_cast<std::size_t>(b)]]);
    offsets(a) = offset(state, all_[i]);
    unit(a) = 1 / prior_sigma(state, i);
  }
  if (k == 0 || !P.allFinite()) return {};
  // In units of the priors. No direction is more uncertain than they are, but for rounding.
  const Eigen::SelfAdjointEigenSolver<RowMatrix> eigen(unit.asDiagonal() * P * unit.asDiagonal());
  const RowVector inverse = eigen.eigenvalues().cwiseMin(1.0).cwiseMax(kSmallest).cwiseInverse();
  const RowVector gained = (inverse.array() - 1) / dispersion;
  const RowMatrix V = unit.asDiagonal() * eigen.eigenvectors();
  out.information = V * gained.asDiagonal() * V.transpose();
  out.score = V * (inverse.cwiseProduct(V.transpose() * offsets) / dispersion);
  return out;
}

/// Posterior N(m, C) of the parameters with priors N(0, D), by the likelihood alone.
CalibrationMonitor::Posterior CalibrationMonitor::posterior(const Likelihood& of,
                                                            const Opened& opened) const {
  const auto k = static_cast<Eigen::Index>(of.count);
  RowVector sigmas(k);
  for (std::size_t a = 0; a < of.count; ++a) {
    const ParameterSigmas& prior = all_[of.rows[a]].sigmas;
    sigmas(static_cast<Eigen::Index>(a)) = opened.test(a) ? prior.open : prior.closed;
  }
  RowMatrix scaled = sigmas.asDiagonal() * of.information * sigmas.asDiagonal();
  scaled.diagonal().array() += 1;
  const Eigen::LLT<RowMatrix> llt(scaled);
  Posterior out;
  out.mean = sigmas.cwiseProduct(of.score);
  llt.matrixL().solveInPlace(out.mean);
  out.evidence = 0.5 * out.mean.squaredNorm() - llt.matrixLLT().diagonal().array().log().sum();
  llt.matrixU().solveInPlace(out.mean);
  out.mean = sigmas.cwiseProduct(out.mean).eval();
  out.covariance = RowMatrix::Identity(k, k);
  llt.solveInPlace(out.covariance);
  out.covariance = (sigmas.asDiagonal() * out.covariance * sigmas.asDiagonal()).eval();
  return out;
}

/// Bayesian model average over the closed groups: second moment of each group's error, with the
/// probability that the group is wrong. A wide prior of a group replaces the tight one in the
/// group's marginal posterior N(m, C): precision C⁻¹ + 1/open² − 1/closed², and the odds are the
/// mean of the priors' ratio.
void CalibrationMonitor::average(const FilterState& state, const Likelihood& of) {
  if (of.count == 0) return;
  Opened now;
  for (std::size_t a = 0; a < of.count; ++a) now.set(a, state.parameter_tests[of.rows[a]].is_open);
  const Posterior base = posterior(of, now);
  using GroupMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostOfGroup, kMostOfGroup>;
  using GroupVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostOfGroup, 1>;
  for (Doubt& doubt : doubts_) {
    GroupMatrix C(doubt.count, doubt.count);
    GroupVector m(doubt.count);
    GroupVector wider(doubt.count);  // of the precision
    std::array<Eigen::Index, kMostOfGroup> at{};
    int count = 0;
    double log_odds = std::log(kWrong);
    bool is_open = false;
    for (std::size_t a = 0; a < of.count && count < doubt.count; ++a) {
      if (of.rows[a] != doubt.rows[static_cast<std::size_t>(count)]) continue;
      const ParameterSigmas& prior = all_[of.rows[a]].sigmas;
      m(count) = base.mean(static_cast<Eigen::Index>(a));
      wider(count) = std::pow(prior.open, -2) - std::pow(prior.closed, -2);
      log_odds -= std::log(prior.open / prior.closed);
      is_open |= now.test(a);
      at[static_cast<std::size_t>(count++)] = static_cast<Eigen::Index>(a);
    }
    if (count < doubt.count) continue;  // not tested with this image
    doubt.moment.setZero();
    if (is_open) continue;
    for (int a = 0; a < count; ++a)
      for (int b = 0; b < count; ++b)
        C(a, b) = base.covariance(at[static_cast<std::size_t>(a)], at[static_cast<std::size_t>(b)]);
    const GroupMatrix tight = C.inverse();
    GroupMatrix precision = tight;
    precision.diagonal() += wider;
    const Eigen::LLT<GroupMatrix> llt(precision);
    if (llt.info() != Eigen::Success) continue;
    const GroupVector mean = llt.solve(tight * m);
    log_odds +=
        0.5 * (std::log(tight.determinant()) + mean.dot(precision * mean) - m.dot(tight * m)) -
        llt.matrixLLT().diagonal().array().log().sum();
    const double odds = std::exp(std::min(log_odds, kMostLogOdds));
    const double share = odds / (1 + odds);
    const GroupMatrix moment =
        share * (llt.solve(GroupMatrix::Identity(count, count)) + mean * mean.transpose());
    if (std::isfinite(share) && moment.allFinite())
      doubt.moment.topLeftCorner(count, count) = moment;
  }
}

/// The parameters that explain the data best when they are open: rows of `all_`. Groups are added
/// one by one; those that explain the data as well as one of them are added, too.
std::vector<std::size_t> CalibrationMonitor::select(const Likelihood& of) const {
  std::vector<Opened> groups;
  Opened chosen;
  for (std::size_t a = 0; a < of.count; ++a) {
    const auto same = std::ranges::find_if(groups, [&](const Opened& group) {
      for (std::size_t b = 0; b < a; ++b)
        if (group.test(b)) return is_same_group(all_[of.rows[b]], all_[of.rows[a]]);
      return false;
    });
    (same == groups.end() ? groups.emplace_back() : *same).set(a);
  }
  double best = posterior(of, chosen).evidence;
  const double none = best;
  for (double least = kNeedsOne;; least = kNeedsBoth) {
    Opened next;
    double most = best + least;
    for (const Opened& group : groups) {
      if ((chosen & group).any()) continue;
      const double found = posterior(of, chosen | group).evidence;
      if (!(found > most)) continue;
      most = found;
      next = chosen | group;
    }
    if (next.none()) break;
    best = most;
    chosen = next;
  }
  Opened all = chosen;
  for (const Opened& out : groups) {
    for (const Opened& in : groups) {
      if ((chosen & out).none() || (chosen & in).any()) continue;
      const double without = std::max(none, posterior(of, chosen & ~out).evidence);
      const double instead = posterior(of, (chosen & ~out) | in).evidence;
      if (instead > best - kAsGood && instead > without + kBetterThanNone) all |= in;
    }
  }
  std::vector<std::size_t> opened;
  for (std::size_t a = 0; a < of.count; ++a)
    if (all.test(a)) opened.push_back(of.rows[a]);
  return opened;
}

}  // namespace fiducap::world
