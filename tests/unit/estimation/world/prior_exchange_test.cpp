// A prior is exchanged while tags are held, against the arithmetic of normal distributions.
#include "estimation/world/calibration_monitor.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "support/jacobian_check.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

constexpr double kTiny = 1e-7;  // of a state: nothing turns its covariance noticeably

/// The second and the third tag of three are held.
class PriorExchange : public testing::Test {
 protected:
  PriorExchange() : state_(example_state()) {
    state_.tags[1].held = state_.tags[2].held = true;
    state_.release_blocks();
    for (int i = 0; i < state_.size(); ++i) {
      const bool is_held = i >= state_.tag_at(1);
      (is_held ? held_ : rest_).push_back(i);
    }
    sigma_ = 1.2 * std::sqrt(state_.P()(column_, column_));
  }

  /// p(rest | held) with another prior, and p(held) as it was.
  void replace_prior(double to_sigma, double value) {
    const Eigen::MatrixXd P = state_.P();
    const Eigen::MatrixXd of_held = P(held_, held_);
    const Eigen::MatrixXd A = P(rest_, held_) * inverse(of_held);
    const Eigen::MatrixXd given = P(rest_, rest_) - A * P(held_, rest_);
    Eigen::MatrixXd information = inverse(given);
    information(column_, column_) += 1 / (to_sigma * to_sigma) - 1 / (sigma_ * sigma_);
    const Eigen::MatrixXd now_given = inverse(information);
    const Eigen::MatrixXd by_before = now_given * inverse(given);
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(rest_.size()));
    mean(column_) = value;
    moved_ = by_before * mean - mean;
    expected_ = P;
    expected_(rest_, held_) = by_before * A * of_held;
    expected_(held_, rest_) = expected_(rest_, held_).transpose();
    expected_(rest_, rest_) = now_given + propagated(by_before * A, of_held);
  }

  FilterState state_;
  std::vector<int> held_;
  std::vector<int> rest_;
  int column_{layout::focal(0)};
  double sigma_{};
  Eigen::MatrixXd expected_;
  Eigen::VectorXd moved_;
};

TEST_F(PriorExchange, ChangesTheStatesCorrelatedWithHeldTagsButNotTheTags) {
  for (const double to_sigma : {30 * sigma_, 0.2 * sigma_}) {
    const FilterState before = state_;
    replace_prior(to_sigma, kTiny);
    exchange_prior(state_, 0, column_, kTiny, sigma_, to_sigma);
    const Eigen::MatrixXd P = state_.P();
    EXPECT_LT((P - expected_).norm(), 1e-5 * expected_.norm());
    EXPECT_NEAR(state_.lenses[0].focal - before.lenses[0].focal, moved_(column_), 1e-12);
    const Eigen::Vector3d faster = state_.v_WB - before.v_WB;
    EXPECT_LT((state_.bias_f - before.bias_f - moved_.segment<3>(layout::kBiasF)).norm(), 1e-12);
    EXPECT_GT(faster.norm(), 1e-3 * kTiny) << "the body follows";
    EXPECT_EQ(state_.tags[1].X_WT.p, before.tags[1].X_WT.p);
    state_ = before;
  }
}

// All tags, and so the body, have a common error of metres, correlated with the column. The body
// keeps its pose relative to its tags.
TEST_F(PriorExchange, DoesNotMoveTheBodyAlongWithAnErrorOfTheWholeMap) {
  auto P = state_.P();
  P.setZero();
  constexpr double kOfAll = 1.0;
  Eigen::VectorXd all = Eigen::VectorXd::Zero(state_.size());
  for (const int at : {layout::kPosition, state_.tag_at(0), state_.tag_at(1), state_.tag_at(2)})
    all(at) = kOfAll;
  all(column_) = 1e-4;
  P = all * all.transpose();
  P.diagonal().array() += 1e-6;
  P(column_, column_) = 1e-6;
  P(layout::kPosition, column_) += 5e-7;
  P(column_, layout::kPosition) += 5e-7;
  const Eigen::Vector3d p = state_.X_WB.p;
  const double among_tags = 5e-7 / 1e-6 * kTiny;  // with the column, when that is free
  exchange_prior(state_, 0, column_, kTiny, 1.1e-3, 1.0);
  const double expected_m = among_tags * (1 / (1 - 1e-6 / (1.1e-3 * 1.1e-3)) - 1);
  EXPECT_NEAR((state_.X_WB.p - p).x(), expected_m, 0.1 * expected_m);
}

TEST_F(PriorExchange, WideningDoesNotChangeHeldTagsAndClosedParameters) {
  const Eigen::MatrixXd before = state_.P();
  widen(state_, column_, 2 * sigma_, {layout::readout(0)});
  const Eigen::MatrixXd more = state_.P() - before;
  EXPECT_NEAR(state_.P()(column_, column_), 4 * sigma_ * sigma_, 1e-9);
  EXPECT_EQ(more(held_, held_).norm(), 0);
  EXPECT_EQ(more(held_, rest_).norm(), 0);
  EXPECT_EQ(more.col(layout::readout(0)).norm(), 0);
  EXPECT_GT(more(0, 0), 0);
}

}  // namespace
}  // namespace fiducap::world
