// A map that publishes another place for a tag that a filter holds.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "estimation/world/tag_entry.hpp"
#include "example_room.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

constexpr double kSigma_m = 0.01;

/// The example state, its covariance small, the second tag held and correlated with everything.
FilterState state_with_held_tag() {
  FilterState state = example_state();
  state.P() *= kSigma_m * kSigma_m;
  state.tags[1].held = true;
  state.add_tag(WorldTag{}, Matrix6d::Identity());
  state.remove_tag(state.tags.size() - 1);  // updates the list of held tags
  return state;
}

KnownTag known_of(const FilterState& state, const Vector6d& moved, const Matrix6d& world_cov) {
  FilterState other = state;
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  error.segment<6>(state.tag_at(1)) = moved;
  other.add_error(error);
  const Pose& X_WT = other.tags[1].X_WT;
  const Matrix6d J = plain_from_world_error(X_WT.p);
  return {state.tags[1].tag_id, state.tags[1].edge_m, X_WT, J * world_cov * J.transpose()};
}

TEST(HeldMarginal, MatchesADenseReference) {
  const FilterState before = state_with_held_tag();
  const int n = before.size();
  const int at = before.tag_at(1);
  const Eigen::MatrixXd P = before.P();
  const Matrix6d S = P.block<6, 6>(at, at);
  Matrix6d R = 0.3 * S;
  R.diagonal().array() += 1e-7;
  const Vector6d moved = 0.02 * kSigma_m * Vector6d(1, -2, 3, 1, -1, 2);

  // Reference: p(x, t) = p(x | t) p(t), of which p(t) becomes another Gaussian. The conditional is
  // x = G t + e with cov e = P − G S Gᵀ, so the new joint covariance is that of (G t + e, t).
  Eigen::MatrixXd G = P.middleCols<6>(at) * S.inverse();
  const Eigen::MatrixXd expected = P - G * S * G.transpose() + G * R * G.transpose();
  const Eigen::VectorXd dx = G * moved;

  FilterState after = before;
  ASSERT_TRUE(replace_held(after, 1, known_of(before, moved, R)));
  EXPECT_LT((Eigen::MatrixXd(after.P()) - expected).cwiseAbs().maxCoeff(),
            1e-9 * P.cwiseAbs().maxCoeff());
  EXPECT_LT((after.P().block<6, 6>(at, at) - R).cwiseAbs().maxCoeff(), 1e-12);
  FilterState mean = before;
  mean.add_error(dx);
  EXPECT_LT(mean.error_to(after).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_EQ(n, after.size());
}

TEST(HeldMarginal, TheSameMarginalAgainHasNoEffect) {
  const FilterState before = state_with_held_tag();
  const int at = before.tag_at(1);
  const Matrix6d S = before.P().block<6, 6>(at, at);
  FilterState after = before;
  ASSERT_TRUE(replace_held(after, 1, known_of(before, Vector6d::Zero(), S)));
  EXPECT_LT(before.error_to(after).norm(), 1e-12);
  EXPECT_LT((Eigen::MatrixXd(after.P()) - Eigen::MatrixXd(before.P())).cwiseAbs().maxCoeff(),
            1e-9 * before.P().cwiseAbs().maxCoeff());
}

TEST(HeldMarginal, MayBecomeExact) {
  FilterState state = state_with_held_tag();
  const int at = state.tag_at(1);
  const Eigen::MatrixXd P = state.P();
  const Eigen::MatrixXd conditional =
      P - P.middleCols<6>(at) * P.block<6, 6>(at, at).inverse() * P.middleRows<6>(at);
  ASSERT_TRUE(replace_held(state, 1, known_of(state, Vector6d::Zero(), Matrix6d::Zero())));
  EXPECT_LT((Eigen::MatrixXd(state.P()) - conditional).cwiseAbs().maxCoeff(),
            1e-9 * P.cwiseAbs().maxCoeff());
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
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen{Eigen::MatrixXd(state.P())};
  EXPECT_GT(eigen.eigenvalues().minCoeff(), -1e-12);
}

TEST(HeldMarginal, ATagAtAnotherPlaceWasMoved) {
  FilterState state = state_with_held_tag();
  const int at = state.tag_at(1);
  const Matrix6d S = state.P().block<6, 6>(at, at);
  Vector6d moved = Vector6d::Zero();
  moved(0) = 10 * std::sqrt(S.diagonal().maxCoeff());
  moved(1) = moved(2) = moved(0);
  const FilterState before = state;
  EXPECT_FALSE(replace_held(state, 1, known_of(before, moved, 0.1 * S)));
  EXPECT_LT(before.error_to(state).norm(), 1e-15) << "untouched: nobody knows what it shares now";
}

TEST(LocalAndHeldTag, FusionMatchesADenseSchmidtUpdate) {
  FilterState state = state_with_held_tag();
  Eigen::VectorXd near = Eigen::VectorXd::Zero(state.size());
  near.segment<6>(state.tag_at(1)) = world_error_between(state.tags[1].X_WT, state.tags[0].X_WT) +
                                     0.1 * kSigma_m * Vector6d(1, -1, 2, 0.5, 1, -1);
  state.add_error(near);  // the held tag 1 is close to the body's own tag 0
  const FilterState before = state;
  const Eigen::MatrixXd P = before.P();
  const int a = before.tag_at(0);
  const int b = before.tag_at(1);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(6, before.size());
  H.middleCols<6>(a).setIdentity();
  H.middleCols<6>(b) = -Matrix6d::Identity();
  const Eigen::MatrixXd S = H * P * H.transpose();
  Eigen::MatrixXd K = P * H.transpose() * S.inverse();
  K.middleRows<6>(b).setZero();
  const Eigen::MatrixXd I_KH = Eigen::MatrixXd::Identity(P.rows(), P.cols()) - K * H;
  const Eigen::MatrixXd expected = I_KH * P * I_KH.transpose();
  const Eigen::VectorXd dx = K * world_error_between(before.tags[0].X_WT, before.tags[1].X_WT);
  fuse_with_held(state, 0, 1);
  EXPECT_LT((Eigen::MatrixXd(state.P()) - expected).cwiseAbs().maxCoeff(),
            1e-9 * P.cwiseAbs().maxCoeff());
  FilterState mean = before;
  mean.add_error(dx);
  EXPECT_LT(mean.error_to(state).cwiseAbs().maxCoeff(), 1e-9);
}

// A map that improves while a body looks at it: its errors shrink, each place published is the old
// one with part of its error taken back. A filter that takes every version as independent gets
// overconfident.
TEST(HeldMarginal, AnImprovingMapDoesNotMakeABodyOverconfident) {
  constexpr int kRuns = 12;
  double nees = 0;
  int count = 0;
  for (int run = 0; run < kRuns; ++run) {
    ExampleRoom::Setup setup;
    setup.seed = static_cast<std::uint64_t>(100 + run);
    ExampleRoom room(setup);
    std::mt19937_64 random(setup.seed);
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
        // As if everything had been measured once more: x̂ ← x̂ + K (y − x̂) per number.
        const double more = 4 * sigma;
        const double gain = sigma * sigma / (sigma * sigma + more * more);
        for (auto& [id, e] : error)
          e = (1 - gain) * e + gain * more * Vector6d::NullaryExpr([&] { return gauss(random); });
        sigma *= std::sqrt(1 - gain);
        publish();
      }
      if (i < 60 || i % 10 != 0) continue;
      const BodyEstimate body = room.filter->estimate();
      Vector6d e;
      e << body.X_WB.p - room.truth().p, log_so3(body.X_WB.q * room.truth().q.conjugate());
      nees += e.dot(body.covariance.topLeftCorner<6, 6>().ldlt().solve(e)) / 6;
      ++count;
    }
  }
  nees /= count;
  RecordProperty("nees_per_dof_percent", static_cast<int>(100 * nees));
  std::printf("NEES per degree of freedom %.2f\n", nees);
  // 12 runs, each pose largely of one draw of the map's 36 errors.
  EXPECT_LT(nees, 1.6);
  EXPECT_GT(nees, 0.5);
}

}  // namespace
}  // namespace fiducap::world
