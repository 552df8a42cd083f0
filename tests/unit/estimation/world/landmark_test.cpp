// Measurements of tracked image points: Jacobians, the unobservable directions, and the update
// against a textbook's.
#include <gtest/gtest.h>

#include <random>

#include "base/pose.hpp"
#include "covariance_check.hpp"
#include "estimation/world/landmarks.hpp"
#include "support/allocation_counter.hpp"
#include "support/results.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

constexpr TrackNoise kNoise{0.12, 0.09};

/// A camera that passes by, far from the origin, turning.
std::vector<LandmarkView> passing_views(int count, const Eigen::Vector3d& p_W) {
  std::vector<LandmarkView> views;
  const Eigen::Vector3d towards(0.4, 0.3, 2.5);
  for (int j = 0; j < count; ++j) {
    LandmarkView view;
    view.slot = (j * 3) % count;  // in no order
    view.X_WV.q = exp_so3({0.3 - 0.02 * j, 0.1 * j, 0.5});
    view.X_WV.p = p_W - view.X_WV.q * (towards + Eigen::Vector3d(0.1 * j, -0.03 * j, 0.05 * j));
    view.ideal_from_raw << 1.1, 0.02, -0.03, 0.95;
    view.px = example_camera().pinhole(view.X_WV.inverse() * p_W);
    views.push_back(view);
  }
  return views;
}

const Eigen::Vector3d kPlace(12.0, -7.0, 3.0);

LandmarkMeasurement measured(const std::vector<LandmarkView>& views,
                             const Eigen::Vector3d& p_W = kPlace) {
  LandmarkMeasurement m(static_cast<int>(views.size()));
  EXPECT_TRUE(m.build(example_camera(), views, p_W, kNoise));
  return m;
}

TEST(LandmarkMeasurement, JacobianMatchesTheResidualWithoutTheLandmark) {
  constexpr int n = 5;
  const auto views = passing_views(n, kPlace);
  const LandmarkMeasurement m = measured(views);
  ASSERT_EQ(m.rows(), 2 * n - 3);
  // Pixels when cameras and landmark are off by d; linearised at their nominal poses.
  Eigen::MatrixXd H(m.rows(), 6 * n + 3);
  H << m.H(), Eigen::MatrixXd::Zero(m.rows(), 3);
  const auto residual = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    auto seen = views;
    for (LandmarkView& view : seen) {
      const Eigen::VectorXd e = d.segment<6>(6 * view.slot);
      const Eigen::Quaterniond turn = exp_so3(e.tail<3>());
      const Pose truth{turn * view.X_WV.q,
                       turn * view.X_WV.p + left_jacobian_so3(e.tail<3>()) * e.head<3>()};
      view.px = example_camera().pinhole(truth.inverse() * (kPlace + d.tail<3>()));
    }
    return measured(seen).y();
  };
  expect_jacobian(H, residual, 1e-5);
}

TEST(LandmarkMeasurement, DoesNotObserveTheRoomPoseAtAnyLinearisation) {
  constexpr int n = 6;
  auto views = passing_views(n, kPlace);
  for (std::size_t j = 0; j < views.size(); ++j)
    views[j].X_WV.p += Eigen::Vector3d(0.1, -0.2, 0.15) * std::sin(3.0 * static_cast<double>(j));
  const LandmarkMeasurement m = measured(views, kPlace + Eigen::Vector3d(0.3, 0.2, -0.4));
  const Eigen::MatrixXd shifts = Eigen::MatrixXd::Identity(6, 6).replicate(n, 1);
  EXPECT_LT((m.H() * shifts).cwiseAbs().maxCoeff(), 1e-8 * m.H().cwiseAbs().maxCoeff());
}

TEST(LandmarkMeasurement, ItsResidualHasUnitCovarianceUnderTheNoiseOfATrack) {
  constexpr int n = 5;
  const auto views = passing_views(n, kPlace);
  const Eigen::MatrixXd J = central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        auto seen = views;
        for (std::size_t j = 0; j < n; ++j)
          seen[j].px += seen[j].ideal_from_raw * d.segment<2>(2 * static_cast<Eigen::Index>(j));
        return measured(seen).y();
      },
      2 * n);
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  for (int a = 0; a < n; ++a) {
    for (int b = 0; b < n; ++b) {
      const double r = (a == b ? kNoise.white_px * kNoise.white_px : 0) +
                       kNoise.walk_px * kNoise.walk_px * std::min(a, b);
      R.block<2, 2>(2 * a, 2 * b) = r * Eigen::Matrix2d::Identity();
    }
  }
  expect_matrices_near(propagated(J, R), Eigen::MatrixXd::Identity(2 * n - 3, 2 * n - 3), 1e-6);
}

TEST(Triangulation, FindsThePositionAndItsSigma) {
  const auto views = passing_views(6, kPlace);
  const auto near = value_of(triangulate(example_camera(), views, 0.1));
  EXPECT_LT((near.p_W - kPlace).norm(), 1e-6);
  EXPECT_LT(near.relative_sigma, 0.02);
  const auto short_way = value_of(triangulate(example_camera(), std::span(views).first(2), 0.1));
  EXPECT_GT(short_way.relative_sigma, 4 * near.relative_sigma);
}

TEST(Triangulation, RefusesRaysThatIntersectBehindTheCameras) {
  auto views = passing_views(4, kPlace);
  for (std::size_t j = 0; j < views.size(); ++j) {  // points that run ahead of the camera
    views[j].px = {376 + 40.0 * static_cast<double>(j), 240};
    views[j].X_WV = {Eigen::Quaterniond::Identity(), {0.1 * static_cast<double>(j), 0, 0}};
  }
  EXPECT_FALSE(triangulate(example_camera(), views, 0.1));
}

/// A state whose clones look at one place, one behind the other.
class LandmarkUpdateTest : public testing::Test {
 protected:
  static constexpr int kClones = 5;

  LandmarkUpdateTest() {
    state_.reset({Pose{}}, kClones);
    state_.X_WB = {exp_so3({0.4, -0.6, 1.1}), {4.2, -3.7, 0.9}};
    WorldTag held;
    held.tag_id = 1;
    held.held = true;
    held.X_WT.p = {10, -5, 2};
    state_.add_tag(held, Matrix6d::Identity());
    const auto views = passing_views(kClones, kPlace);
    for (std::size_t j = 0; j < kClones; ++j)
      state_.clones[j] = {views[j].X_WV, 0, static_cast<long>(j)};
    Eigen::MatrixXd A(state_.size(), state_.size());
    for (Eigen::Index i = 0; i < A.size(); ++i) A(i) = gauss_(random_);
    state_.P() = 1e-6 * A * A.transpose();
  }

  std::vector<LandmarkView> noisy_views(const Eigen::Vector3d& p_W) {
    std::vector<LandmarkView> views;
    for (int j = 0; j < kClones; ++j) {
      LandmarkView view;
      view.slot = j;
      view.X_WV = state_.clones[static_cast<std::size_t>(j)].X_WV;
      view.px = example_camera().pinhole(view.X_WV.inverse() * p_W) +
                0.1 * Eigen::Vector2d(gauss_(random_), gauss_(random_));
      views.push_back(view);
    }
    return views;
  }

  std::mt19937 random_{11};
  std::normal_distribution<double> gauss_;
  FilterState state_;
};

TEST_F(LandmarkUpdateTest, EqualsATextbookUpdateWithMoreRowsThanColumns) {
  LandmarkRules rules;
  rules.gate_probability = 0.999999;
  LandmarkUpdate update(kClones, rules);
  FilterState expected = state_;
  const Eigen::MatrixXd P = state_.P();
  Eigen::MatrixXd H(0, state_.size());
  Eigen::VectorXd y(0);
  update.begin();
  for (int i = 0; i < 12; ++i) {
    const auto views = noisy_views(kPlace + Eigen::Vector3d(0.3 * (i % 4), 0.2 * (i % 3), 0.1 * i));
    update.add(state_, example_camera(), views);
    const auto met = triangulate(example_camera(), views, rules.noise.white_px);
    LandmarkMeasurement one(kClones);
    ASSERT_TRUE(met && one.build(example_camera(), views, met->p_W, rules.noise));
    const Eigen::Index at = y.size();
    H.conservativeResize(at + one.rows(), Eigen::NoChange);
    H.bottomRows(one.rows()).setZero();
    H.block(at, state_.clone_at(0), one.rows(), 6 * kClones) = one.H();
    y.conservativeResize(at + one.rows());
    y.tail(one.rows()) = one.y();
  }
  const LandmarkReport report = update.apply(state_);
  ASSERT_EQ(report.used, 12);
  ASSERT_GT(y.size(), 6 * kClones);
  const Eigen::MatrixXd S = propagated(H, P) + Eigen::MatrixXd::Identity(y.size(), y.size());
  const Eigen::MatrixXd K = P * H.transpose() * inverse(S);
  Eigen::VectorXd dx = K * y;
  dx.segment<6>(expected.tag_at(0)).setZero();
  expected.add_error(dx);
  Eigen::MatrixXd after = P - propagated(K, S);
  after.block<6, 6>(expected.tag_at(0), expected.tag_at(0)) =
      P.block<6, 6>(expected.tag_at(0), expected.tag_at(0));
  EXPECT_LT(state_.error_to(expected).norm(), 1e-8);
  EXPECT_LT((state_.P() - after).cwiseAbs().maxCoeff(), 1e-8 * P.cwiseAbs().maxCoeff());
}

TEST_F(LandmarkUpdateTest, IgnoresASlippedTrackAndOneWithoutDepth) {
  state_.P() *= 1e-3;
  LandmarkUpdate update(kClones, {});
  update.begin();
  auto slipped = noisy_views(kPlace);
  slipped[2].px.x() += 12;
  update.add(state_, example_camera(), slipped);
  auto far = noisy_views(kPlace + 3000 * (kPlace - state_.clones[0].X_WV.p));
  update.add(state_, example_camera(), far);
  const FilterState before = state_;
  const LandmarkReport report = update.apply(state_);
  EXPECT_EQ(report.used, 0);
  EXPECT_EQ(report.rejected, 1);
  EXPECT_EQ(report.shallow, 1);
  EXPECT_TRUE(state_.P() == before.P());
}

TEST_F(LandmarkUpdateTest, AllocatesNothingAfterWarmUp) {
  LandmarkUpdate update(kClones, {});
  const auto views = noisy_views(kPlace);
  const auto run = [&] {
    CloneWindow::clone(state_, 0, 100);
    update.begin();
    for (int i = 0; i < 12; ++i) update.add(state_, example_camera(), views);
    return update.apply(state_);
  };
  (void)run();
  const AllocationCounter allocations;
  (void)run();
  EXPECT_EQ(allocations.count(), 0u);
}

TEST(CloneWindow, ACloneHasTheCovarianceOfItsCamera) {
  FilterState after = example_state();
  const auto clone = [](FilterState& state) { CloneWindow::clone(state, 1, 7); };
  clone(after);
  const Eigen::MatrixXd J = jacobian_of<FilterState>(clone, example_state());
  expect_matrices_near(after.P(), propagated(J, example_state().P()), kFirstOrder);
}

TEST(CloneWindow, TheOldestCloneIsReplaced) {
  FilterState state = example_state();
  for (long image = 0; image < 7; ++image) CloneWindow::clone(state, 0, image);
  std::vector<long> images;
  for (const Clone& clone : state.clones) images.push_back(clone.image);
  std::sort(images.begin(), images.end());
  for (std::size_t i = 0; i < images.size(); ++i)
    EXPECT_EQ(images[i], 7 - static_cast<long>(images.size() - i));
}

}  // namespace
}  // namespace fiducap::world
