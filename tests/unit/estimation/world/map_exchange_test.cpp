#include "estimation/world/tag_entry.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "base/pose.hpp"
#include "estimation/world/state_prior.hpp"
#include "support/jacobian_check.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

/// A body, its camera and some tags, all correlated with each other at random.
class MapExchange : public testing::Test {
 protected:
  static constexpr int kTags = 4;

  MapExchange() {
    state_.reset({Pose{exp_so3({0.1, 1.5, 0}), {0.1, 0, 0}}});
    state_.X_WB = {exp_so3({0.1, -0.2, 0.4}), {41, -20, 1}};
    state_.v_WB = {0.5, 0.2, 0};
    for (int i = 0; i < kTags; ++i) {
      WorldTag tag;
      tag.tag_id = i;
      tag.edge_m = 0.2;
      tag.X_WT = {exp_so3({1.5, 0.3 * i, 0}), {40.0 + i, -18, 1 + 0.1 * i}};
      state_.add_tag(tag, Matrix6d::Identity());
    }
    state_.P() = correlated(state_.size(), 0.01);
  }

  Eigen::MatrixXd correlated(int rows, double sigma) {
    Eigen::MatrixXd A(rows, rows);
    for (Eigen::Index i = 0; i < A.size(); ++i) A(i) = gauss_(random_);
    return sigma * sigma / rows * (A * A.transpose());
  }

  /// The map has the tags where the state has them, but for a move of the room.
  KnownMap map_of(const Pose& G, const Eigen::MatrixXd& joint) const {
    KnownMap map;
    map.revision = 1;
    for (int i = 0; i < kTags; ++i) {
      const WorldTag& tag = state_.tags[static_cast<std::size_t>(i)];
      map.tags.push_back({i, tag.edge_m, G * tag.X_WT, joint.block<6, 6>(6 * i, 6 * i)});
      for (int k = i + 1; k < kTags; ++k)
        map.pairs.push_back({i, k, joint.block<6, 6>(6 * i, 6 * k)});
    }
    return map;
  }

  [[nodiscard]] Eigen::MatrixXd joint_of_state() const {
    Eigen::MatrixXd out(6 * kTags, 6 * kTags);
    for (std::size_t a = 0; a < kTags; ++a) {
      for (std::size_t b = 0; b < kTags; ++b) {
        out.block<6, 6>(static_cast<Eigen::Index>(6 * a), static_cast<Eigen::Index>(6 * b)) =
            plain_from_world_error(state_.tags[a].X_WT.p) *
            state_.P().block<6, 6>(state_.tag_at(a), state_.tag_at(b)) *
            plain_from_world_error(state_.tags[b].X_WT.p).transpose();
      }
    }
    return out;
  }

  FilterState state_;
  std::mt19937_64 random_{7};
  std::normal_distribution<double> gauss_;
};

TEST_F(MapExchange, AdoptsTheJointCovarianceOfTheMapAndHoldsItsTags) {
  const Eigen::MatrixXd joint = correlated(6 * kTags, 0.003);
  ASSERT_TRUE(exchange(state_, map_of(Pose{}, joint), true));
  EXPECT_LT((joint_of_state() - joint).norm(), 1e-9 * joint.norm() + 1e-12);
  EXPECT_EQ(state_.held_tags().size(), static_cast<std::size_t>(kTags));
  EXPECT_GT(least_eigenvalue(state_.P()), -1e-9);
}

TEST_F(MapExchange, HasNoEffectWhenNothingChanged) {
  const KnownMap map = map_of(Pose{}, correlated(6 * kTags, 0.003));
  ASSERT_TRUE(exchange(state_, map, true));
  const Eigen::MatrixXd before = state_.P();
  const Pose X_WB = state_.X_WB;
  ASSERT_TRUE(exchange(state_, map, true));
  // The room may differ from the map's pose of it, but not by a metre: tags are known to three
  // millimetres.
  EXPECT_LT((state_.P() - before).norm(), 1e-5 * before.norm());
  EXPECT_LT((state_.X_WB.p - X_WB.p).norm(), 1e-6);
}

TEST_F(MapExchange, TheBodyFollowsTheRoom) {
  const Pose X_TB = state_.tags[1].X_WT.inverse() * state_.X_WB;
  const Pose G{exp_so3({0, 0, 0.3}), {2, -1, 0.5}};
  ASSERT_TRUE(exchange(state_, map_of(G, correlated(6 * kTags, 0.003)), true));
  const Pose now = state_.tags[1].X_WT.inverse() * state_.X_WB;
  EXPECT_LT((now.p - X_TB.p).norm(), 1e-6);
  EXPECT_LT(angle_between(now.q, X_TB.q), 1e-6);
}

TEST_F(MapExchange, TheFiltersRoomPoseDoesNotInfluenceTheMaps) {
  // The body's pose relative to the tags is exact, and the filter is certain of the room's pose.
  for (std::size_t i = 0; i < kTags; ++i) {
    state_.P().middleCols<6>(state_.tag_at(i)).setZero();
    state_.P().middleRows<6>(state_.tag_at(i)).setZero();
    state_.P().block<6, 6>(state_.tag_at(i), state_.tag_at(i)) = 1e-10 * Matrix6d::Identity();
  }
  state_.P().topLeftCorner<6, 6>() = 1e-10 * Matrix6d::Identity();
  // According to the map, all of it may be 10 cm off to one side.
  Eigen::MatrixXd joint = 1e-8 * Eigen::MatrixXd::Identity(6 * kTags, 6 * kTags);
  for (int a = 0; a < kTags; ++a)
    for (int b = 0; b < kTags; ++b) joint(6 * a, 6 * b) += 0.01;
  ASSERT_TRUE(exchange(state_, map_of(Pose{}, joint), true));
  EXPECT_NEAR(body_in_workspace(state_).covariance(0, 0), 0.01, 1e-3);
}

TEST_F(MapExchange, ATagAtAnotherPlaceInTheMapLeavesTheState) {
  KnownMap map = map_of(Pose{}, correlated(6 * kTags, 0.003));
  map.tags[2].X_WT.p.x() += 2;
  ASSERT_TRUE(exchange(state_, map, true));
  EXPECT_EQ(state_.find(2), -1);
  EXPECT_GE(state_.find(3), 0);
}

TEST_F(MapExchange, AnAddedTagIsCorrelatedAsInTheMap) {
  const Eigen::MatrixXd joint = correlated(6 * kTags, 0.003);
  const KnownMap map = map_of(Pose{}, joint);
  ASSERT_TRUE(exchange(state_, map, true));
  const FilterState all = state_;
  state_.remove_tag(kTags - 1);
  hold_beside(state_, map.tags[kTags - 1], map, Instant{});
  EXPECT_LT((joint_of_state() - joint).norm(), 1e-6 * joint.norm());
  EXPECT_GT(least_eigenvalue(state_.P()), -1e-9);
}

TEST_F(MapExchange, MissingCovariancesFollowFromTheTagsBetween) {
  // A chain: each tag's error is that of the one before and something of its own.
  Eigen::MatrixXd joint(6 * kTags, 6 * kTags);
  for (int a = 0; a < kTags; ++a) {
    for (int b = 0; b < kTags; ++b)
      joint.block<6, 6>(6 * a, 6 * b) = 1e-4 * (1 + std::min(a, b)) * Matrix6d::Identity();
  }
  KnownMap map = map_of(Pose{}, joint);
  std::erase_if(map.pairs, [](const KnownPair& p) { return p.second_id != p.first_id + 1; });
  std::vector<const KnownTag*> tags;
  for (const KnownTag& tag : map.tags) tags.push_back(&tag);
  EXPECT_LT((joint_covariance(tags, map) - joint).norm(), 1e-6 * joint.norm());
}

TEST_F(MapExchange, AnInconsistentMapGivesAValidCovariance) {
  Eigen::MatrixXd joint = correlated(6 * kTags, 0.003);
  joint.block<6, 6>(0, 6) *= 30;
  joint.block<6, 6>(12, 18) *= -50;
  ASSERT_TRUE(exchange(state_, map_of(Pose{}, joint), true));
  EXPECT_GT(least_eigenvalue(joint_of_state()), -1e-9);
}

// As in a map without further corrections: each tag depends on those before it, none is adopted as
// a whole.
TEST_F(MapExchange, AWalkAlongAThousandTagsKeepsAValidCovariance) {
  constexpr int kWalk = 1000;
  constexpr std::size_t kHeld = 12;
  const Eigen::MatrixXd of_all = correlated(6, 0.03);
  KnownMap map;
  map.revision = 1;
  for (int i = 0; i < kWalk; ++i) {
    const double turned = 0.01 * i;
    map.tags.push_back({i, 0.2, Pose{exp_so3({1.5, turned, 0}), {0.5 * i, -18, 1}},
                        of_all + Matrix6d(correlated(6, 0.001))});
    for (int k = std::max(0, i - 4); k < i; ++k) map.pairs.push_back({k, i, of_all});
  }
  std::sort(map.pairs.begin(), map.pairs.end(), [](const KnownPair& a, const KnownPair& b) {
    return std::pair(a.first_id, a.second_id) < std::pair(b.first_id, b.second_id);
  });
  for (int i = 0; i < kTags; ++i) state_.remove_tag(0);
  for (const KnownTag& tag : map.tags) {
    hold_beside(state_, tag, map, Instant{});
    if (state_.tags.size() > kHeld) state_.remove_tag(0);
  }
  const Eigen::MatrixXd P = state_.P();
  EXPECT_LT((P - P.transpose()).norm(), 1e-12 * P.norm());
  EXPECT_GT(least_eigenvalue(P), -1e-12 * P.norm());
}

constexpr double kTiny = 1e-7;  // of a state: nothing turns its covariance noticeably

/// The second and the third tag of three are held.
class PriorExchange : public testing::Test {
 protected:
  PriorExchange() : state_(example_state()) {
    state_.tags[1].held = state_.tags[2].held = true;
    state_.release_blocks();
    std::vector<int> held, rest;
    for (int i = 0; i < state_.size(); ++i) {
      const bool is_held = i >= state_.tag_at(1);
      (is_held ? held : rest).push_back(i);
    }
    held_ = selection(held, state_.size());
    rest_ = selection(rest, state_.size());
    sigma_ = 1.2 * std::sqrt(state_.P()(column_, column_));
  }

  /// p(rest | held) with another prior, and p(held) as it was.
  void replace_prior(double to_sigma, double value) {
    const Eigen::MatrixXd P = state_.P();
    const Eigen::MatrixXd of_held = propagated(held_, P);
    const Eigen::MatrixXd A = rest_ * P * held_.transpose() * inverse(of_held);
    const Eigen::MatrixXd given = propagated(rest_, P) - propagated(A, of_held);
    Eigen::MatrixXd information = inverse(given);
    information(column_, column_) += 1 / (to_sigma * to_sigma) - 1 / (sigma_ * sigma_);
    const Eigen::MatrixXd now_given = inverse(information);
    const Eigen::MatrixXd by_before = now_given * inverse(given);
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(rest_.rows());
    mean(column_) = value;
    moved_ = by_before * mean - mean;
    const Eigen::MatrixXd of_both = rest_.transpose() * by_before * A * of_held * held_;
    expected_ = propagated(held_.transpose(), of_held) + of_both + of_both.transpose() +
                propagated(rest_.transpose(), now_given + propagated(by_before * A, of_held));
  }

  [[nodiscard]] Eigen::VectorXd unit() const {
    return Eigen::VectorXd::Unit(state_.size(), column_);
  }

  void exchange(double from_sigma, double to_sigma) {
    const auto one = [](double x) { return Eigen::VectorXd::Constant(1, x); };
    exchange_priors(state_, 0, {unit(), one(kTiny)}, one(from_sigma), one(to_sigma));
  }

  FilterState state_;
  Eigen::MatrixXd held_;  ///< Selects the held tags' numbers.
  Eigen::MatrixXd rest_;  ///< Selects all others.
  int column_{layout::focal(0)};
  double sigma_{};
  Eigen::MatrixXd expected_;
  Eigen::VectorXd moved_;
};

TEST_F(PriorExchange, ChangesTheStatesCorrelatedWithHeldTagsButNotTheTags) {
  for (const double to_sigma : {30 * sigma_, 0.2 * sigma_}) {
    const FilterState before = state_;
    replace_prior(to_sigma, kTiny);
    exchange(sigma_, to_sigma);
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
  exchange(1.1e-3, 1.0);
  const double expected_m = among_tags * (1 / (1 - 1e-6 / (1.1e-3 * 1.1e-3)) - 1);
  EXPECT_NEAR((state_.X_WB.p - p).x(), expected_m, 0.1 * expected_m);
}

// By linearisation a variance may exceed its prior: the data say nothing about the number.
TEST_F(PriorExchange, OpensANumberThatIsMoreUncertainThanItsPrior) {
  state_.clear_column(column_, sigma_);
  exchange(0.97 * sigma_, 30 * sigma_);
  EXPECT_NEAR(std::sqrt(state_.P()(column_, column_)), 31 * sigma_, sigma_);
}

TEST_F(PriorExchange, WideningDoesNotChangeHeldTagsAndClosedParameters) {
  const Eigen::MatrixXd before = state_.P();
  widen(state_, unit(), 2 * sigma_, {{layout::readout(0)}, {}});
  const Eigen::MatrixXd more = state_.P() - before;
  EXPECT_NEAR(state_.P()(column_, column_), 4 * sigma_ * sigma_, 1e-9);
  EXPECT_EQ((held_ * more).norm(), 0);
  EXPECT_EQ(more.col(layout::readout(0)).norm(), 0);
  EXPECT_GT(more(0, 0), 0);
}

}  // namespace
}  // namespace fiducap::world
