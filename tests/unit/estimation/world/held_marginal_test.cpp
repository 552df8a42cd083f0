// A map that publishes another place for a tag that a filter holds.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "base/pose.hpp"
#include "estimation/world/tag_entry.hpp"
#include "example_room.hpp"
#include "support/jacobian_check.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

constexpr double kSigma_m = 0.01;

/// The example state, its covariance small, the second tag held and correlated with everything.
struct HeldTag {
  HeldTag() : state(example_state()) {
    state.P() *= kSigma_m * kSigma_m;
    state.tags[1].held = true;
    state.release_blocks();  // updates the list of held tags
    P = state.P();
    S = P.block<6, 6>(at, at);
  }
  /// The held tag of the map, moved, with a covariance in the state's coordinates.
  [[nodiscard]] KnownTag known(const Vector6d& moved, const Matrix6d& covariance) const {
    const WorldTag& tag = state.tags[1];
    const Pose X_WT = world::moved(tag.X_WT, moved);
    return {tag.tag_id, tag.edge_m, X_WT, propagated(plain_from_world_error(X_WT.p), covariance)};
  }
  /// Mean and covariance after an update from `before`.
  static void expect_update(const FilterState& after, const FilterState& before,
                            const Eigen::VectorXd& dx, const Eigen::MatrixXd& expected) {
    EXPECT_LT((after.P() - expected).cwiseAbs().maxCoeff(),
              1e-9 * before.P().cwiseAbs().maxCoeff());
    FilterState mean = before;
    mean.add_error(dx);
    EXPECT_LT(mean.error_to(after).cwiseAbs().maxCoeff(), 1e-9);
  }

  FilterState state;
  const int at = example_state().tag_at(1);
  Eigen::MatrixXd P;  ///< Of the whole state.
  Matrix6d S;         ///< Of the tag.
};

TEST(HeldMarginal, MatchesADenseReference) {
  HeldTag held;
  Matrix6d R = 0.3 * held.S;
  R.diagonal().array() += 1e-7;
  const Vector6d moved = 0.02 * kSigma_m * Vector6d(1, -2, 3, 1, -1, 2);

  // Reference: p(x, t) = p(x | t) p(t), of which p(t) becomes another Gaussian. The conditional is
  // x = G t + e with cov e = P − G S Gᵀ, so the new joint covariance is that of (G t + e, t).
  const Eigen::MatrixXd G = held.P.middleCols<6>(held.at) * inverse(held.S);
  const FilterState before = held.state;
  ASSERT_TRUE(replace_held(held.state, 1, held.known(moved, R)));
  HeldTag::expect_update(held.state, before, G * moved,
                         held.P - propagated(G, held.S) + propagated(G, R));
  EXPECT_LT((held.state.P().block<6, 6>(held.at, held.at) - R).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(held.state.size(), before.size());
}

TEST(HeldMarginal, TheSameMarginalAgainHasNoEffect) {
  HeldTag held;
  const FilterState before = held.state;
  ASSERT_TRUE(replace_held(held.state, 1, held.known(Vector6d::Zero(), held.S)));
  EXPECT_LT(before.error_to(held.state).norm(), 1e-12);
  expect_matrices_near(held.state.P(), held.P, 1e-9);
}

TEST(HeldMarginal, MayBecomeExact) {
  HeldTag held;
  const Eigen::MatrixXd conditional =
      held.P - propagated(held.P.middleCols<6>(held.at), inverse(held.S));
  ASSERT_TRUE(replace_held(held.state, 1, held.known(Vector6d::Zero(), Matrix6d::Zero())));
  EXPECT_LT((held.state.P() - conditional).cwiseAbs().maxCoeff(),
            1e-9 * held.P.cwiseAbs().maxCoeff());
}

TEST(HeldMarginal, MayBeExactInSomeDirectionsOnly) {
  // The map's reference tag: place and heading by definition, tilt measured.
  FilterState state = example_state();
  state.P() *= kSigma_m * kSigma_m;
  KnownTag known{99, 0.2, {exp_so3({0.3, 1.2, -0.4}), {3, -2, 1}}, Matrix6d::Zero()};
  known.covariance.diagonal() << 0, 0, 0, 1e-6, 1e-6, 0;
  hold(state, known, Instant{});
  const std::size_t tag = state.tags.size() - 1;
  known.covariance *= 0.5;
  known.X_WT.q = exp_so3({5e-4, 0, 0}) * known.X_WT.q;
  EXPECT_TRUE(replace_held(state, tag, known));
  EXPECT_TRUE(state.P().allFinite());
  EXPECT_GT(least_eigenvalue(state.P()), -1e-12);
}

TEST(HeldMarginal, ATagAtAnotherPlaceIsNotReplaced) {
  HeldTag held;
  Vector6d moved = Vector6d::Zero();
  moved.head<3>().setConstant(10 * std::sqrt(held.S.diagonal().maxCoeff()));
  const FilterState before = held.state;
  EXPECT_FALSE(replace_held(held.state, 1, held.known(moved, 0.1 * held.S)));
  EXPECT_LT(before.error_to(held.state).norm(), 1e-15) << "its correlations are unknown";
}

TEST(LocalAndHeldTag, FusionMatchesADenseSchmidtUpdate) {
  HeldTag held;
  FilterState& state = held.state;
  Eigen::VectorXd near = Eigen::VectorXd::Zero(state.size());
  near.segment<6>(held.at) = world_error_between(state.tags[1].X_WT, state.tags[0].X_WT) +
                             0.1 * kSigma_m * Vector6d(1, -1, 2, 0.5, 1, -1);
  state.add_error(near);  // the held tag 1 is close to the body's own tag 0
  const FilterState before = state;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(6, state.size());
  H.middleCols<6>(state.tag_at(0)).setIdentity();
  H.middleCols<6>(held.at) = -Matrix6d::Identity();
  Eigen::MatrixXd K = held.P * H.transpose() * inverse(propagated(H, held.P));
  K.middleRows<6>(held.at).setZero();
  const Eigen::MatrixXd I_KH = Eigen::MatrixXd::Identity(held.P.rows(), held.P.cols()) - K * H;
  const Eigen::VectorXd dx = K * world_error_between(before.tags[0].X_WT, before.tags[1].X_WT);
  fuse_with_held(state, 0, 1);
  HeldTag::expect_update(state, before, dx, propagated(I_KH, held.P));
}

// While a body uses it, the map improves: each published pose is the old one with a smaller error.
// A filter that takes every version as independent is overconfident.
TEST(HeldMarginal, AnImprovingMapDoesNotMakeABodyOverconfident) {
  constexpr int kRuns = 12;
  double nees = 0;
  int count = 0;
  for (int run = 0; run < kRuns; ++run) {
    const auto seed = static_cast<std::uint64_t>(100 + run);
    ExampleRoom room({.seed = seed});
    std::mt19937_64 random(seed);
    std::normal_distribution<double> gauss;
    std::map<int, Vector6d> error;
    double sigma = 0.02;
    for (const auto& [id, X] : room.tags)
      error[id] = sigma * Vector6d::NullaryExpr([&] { return gauss(random); });
    std::vector<KnownTag> map;
    const auto publish = [&] {
      map.clear();
      for (const auto& [id, X_RT] : room.tags) {
        KnownTag tag = room.known(id, X_RT, sigma);
        tag.X_WT.p -= error[id].head<3>();
        tag.X_WT.q = exp_so3(-error[id].tail<3>()) * X_RT.q;
        map.push_back(tag);
      }
    };
    publish();
    for (int i = 0; i < 240; ++i) {
      room.next_image({.tags = map, .may_define_workspace = false});
      if (i >= 20 && i % 4 == 0) {
        // As with one more measurement of everything: x̂ ← x̂ + K (y − x̂) per number.
        const double more = 4 * sigma;
        const double gain = sigma * sigma / (sigma * sigma + more * more);
        for (auto& [id, e] : error)
          e = (1 - gain) * e + gain * more * Vector6d::NullaryExpr([&] { return gauss(random); });
        sigma *= std::sqrt(1 - gain);
        publish();
      }
      if (i < 60 || i % 10 != 0) continue;
      nees += room.pose_nees();
      ++count;
    }
  }
  nees /= count;
  RecordProperty("nees_per_dof_percent", static_cast<int>(100 * nees));
  // 12 runs, each pose largely of one draw of the map's 36 errors.
  EXPECT_LT(nees, 1.6);
  EXPECT_GT(nees, 0.5);
}

}  // namespace
}  // namespace fiducap::world
