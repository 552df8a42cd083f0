// Every analytic Jacobian of the robocentric filter against central differences, and every change
// of the covariance against the Jacobian of the change of the mean.
#include <gtest/gtest.h>

#include <random>

#include "base/pose.hpp"
#include "covariance_check.hpp"
#include "estimation/robocentric/filter_state.hpp"
#include "estimation/robocentric/motion.hpp"
#include "example_tags.hpp"

namespace fiducap::robocentric {
namespace {

using namespace layout;  // NOLINT

const Eigen::Vector3d kGravity(0, 0, -9.81);

/// A body with two cameras and three tags in front of camera 0, nothing aligned with anything.
FilterState example_state() {
  FilterState state;
  state.p_WB_B = {1.2, -0.7, 0.9};
  state.v_WB_B = {0.5, 0.3, -0.4};
  state.q_WB = exp_so3({0.4, -0.6, 1.1});
  state.bias_f = {0.05, -0.04, 0.06};
  state.bias_w = {0.006, -0.004, 0.005};
  state.X_BV = {{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}},
                {exp_so3({0.15, -1.45, 0.1}), {0.06, 0.11, 0.02}}};
  state.resize_covariance();
  std::mt19937 random(7);
  std::normal_distribution<double> gauss;
  const auto positive = [&](int n) {
    Eigen::MatrixXd A(n, n);
    for (int i = 0; i < n * n; ++i) A(i) = gauss(random);
    return Eigen::MatrixXd(0.01 * A * A.transpose());
  };
  for (int i = 0; i < 3; ++i) {
    LocalTag tag;
    tag.tag_id = 10 + i;
    tag.edge_m = 0.2;
    tag.X_VT = {exp_so3({3.0 + 0.1 * i, 0.2 - 0.3 * i, 0.4}),
                {-0.3 + 0.3 * i, 0.1 * i, 1.5 + 0.4 * i}};
    state.add_tag(tag, Matrix6d::Identity());
  }
  state.P() = positive(state.size());
  return state;
}

class StepJacobian : public testing::TestWithParam<bool> {};

TEST_P(StepJacobian, MatchesDifferences) {
  const InertialInput input = example_input(GetParam());
  MotionSinceImage start;
  start.X_B0B = {exp_so3({0.2, 0.1, -0.3}), {0.1, -0.2, 0.3}};
  for (const double dt : {1e-6, 0.005, 0.05}) {
    FilterState mean = example_state();
    MotionSinceImage motion = start;
    const StepJacobians jacobians = step_mean(mean, motion, input, kGravity, dt);
    const auto f = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      FilterState state = example_state();
      Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
      error.head<kBodySize>() = d.head<kBodySize>();
      state.add_error(error);
      MotionSinceImage step = start;
      step.X_B0B.p += step.X_B0B.q * d.segment<3>(kStepPosition);
      step.X_B0B.q = step.X_B0B.q * exp_so3(d.segment<3>(kStepAttitude));
      static_cast<void>(step_mean(state, step, input, kGravity, dt));
      Eigen::VectorXd out(kMotionSize);
      out.head<kBodySize>() = mean.error_to(state).head<kBodySize>();
      out.segment<3>(kStepPosition) = motion.X_B0B.q.conjugate() * (step.X_B0B.p - motion.X_B0B.p);
      out.segment<3>(kStepAttitude) = log_so3(motion.X_B0B.q.conjugate() * step.X_B0B.q);
      return out;
    };
    // The force is turned by half the rotation, whose Jacobian is taken to first order in w dt.
    expect_jacobian(jacobians.F, f, dt < 0.01 ? 1e-6 : 2e-4);
  }
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutAccelerometer, StepJacobian, testing::Bool());

void propagate_and_apply(FilterState& state, int steps) {
  MotionSinceImage motion;
  for (int i = 0; i < steps; ++i) propagate(state, motion, example_input(true), kGravity, 0.005);
  FrameTransition().apply(state, motion);
}

TEST(FrameTransition, CovarianceFollowsTheMean) {
  expect_covariance_follows_mean<FilterState>(
      example_state(), [](FilterState& state) { propagate_and_apply(state, 10); });
}

TEST(FrameTransition, KeepsTagsInTheWorkspace) {
  const FilterState before = example_state();
  FilterState after = before;
  propagate_and_apply(after, 50);
  for (std::size_t i = 0; i < before.tags.size(); ++i) {
    const Pose X_WT = tag_in_workspace(before, i).X_WT;
    EXPECT_LT((tag_in_workspace(after, i).X_WT.p - X_WT.p).norm(), 1e-10);
    EXPECT_LT(angle_between(tag_in_workspace(after, i).X_WT.q, X_WT.q), 1e-9);
  }
}

/// A tag in view of one of two cameras, in the state or known.
class MeasurementJacobian : public testing::TestWithParam<std::tuple<int, bool>> {
 protected:
  void show(int camera, bool is_known) {
    seen_.edge_m = 0.2;
    use_ = {&seen_, is_known ? -1 : 1, is_known ? &known_ : nullptr};
    seen_ = example_observation(11, 0.2, predicted_tag(state_, camera, use_), model_);
  }
  const FilterState state_ = example_state();
  const CameraModel model_ = example_camera();
  KnownTag known_{11, 0.2, tag_in_workspace(state_, 1).X_WT, Matrix6d::Zero()};
  TagObservation seen_;
  TagToUse use_;
};

TEST_P(MeasurementJacobian, MatchesDifferences) {
  const int camera = std::get<0>(GetParam());
  show(camera, std::get<1>(GetParam()));
  const TagMeasurement m = measure(state_, camera, model_, use_, 0.4);
  ASSERT_TRUE(m.in_front);
  EXPECT_LT(m.y.norm(), 1e-9);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(8, state_.size());
  for (std::size_t b = 0; b < m.block_count; ++b) H.middleCols<3>(m.blocks[b].at) += m.blocks[b].H;
  expect_jacobian(-H, [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    return measure(with_error(state_, d), camera, model_, use_, 0.4).y;
  });
}

INSTANTIATE_TEST_SUITE_P(CamerasAndKinds, MeasurementJacobian,
                         testing::Combine(testing::Values(0, 1), testing::Bool()));

TEST_P(MeasurementJacobian, IncludesTheCovarianceOfAKnownPose) {
  if (!std::get<1>(GetParam())) return;
  const int camera = std::get<0>(GetParam());
  show(camera, true);
  known_.covariance.diagonal() << 1e-4, 4e-4, 9e-4, 1e-3, 2e-3, 3e-3;
  const Eigen::MatrixXd J = central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        KnownTag other = known_;
        other.X_WT.p += d.head<3>();
        other.X_WT.q = exp_so3(d.tail<3>()) * other.X_WT.q;
        return measure(state_, camera, model_, {&seen_, -1, &other}, 0.4).y;
      },
      6);
  const Matrix8d white = 0.16 * Matrix8d::Identity();
  expect_matrices_near(measure(state_, camera, model_, use_, 0.4).R,
                       propagated(J, known_.covariance) + white, 1e-5);
}

TEST(WorkspaceAxes, AreThoseOfTheReferenceTag) {
  expect_anchoring<FilterState>(example_state(), [](const FilterState& s) { return s.X_WB(); });
}

TEST(TagAugmentation, ATagOfTheSecondCameraHasTheErrorsOfBothExtrinsics) {
  const CameraModel model = example_camera();
  const FilterState before = example_state();
  const Pose X_V1T{exp_so3({3.0, 0.2, 0.1}), {0.1, 0.05, 1.2}};
  const TagObservation seen = example_observation(42, 0.2, X_V1T, model);
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() =
      (before.X_BV[0].inverse() * before.X_BV[1]).rotation();
  const CornerResidual r = corner_residual(seen, X_V1T, model);
  const int size = before.size() + 6;
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(size, size);
  noise.bottomRightCorner<6, 6>() = propagated(
      turn, inverse(propagated(r.H.transpose(), Eigen::MatrixXd::Identity(8, 8)) / 0.16));
  expect_covariance_follows_mean<FilterState>(
      before, [&](FilterState& state) { augment(state, 1, model, seen, X_V1T, 0.4); }, noise);
}

TEST(FilterState, RemovingATagDoesNotChangeTheOthers) {
  FilterState state = example_state();
  const FilterState before = state;
  state.remove_tag(1);
  ASSERT_EQ(state.tags.size(), 2u);
  EXPECT_EQ(state.tags[1].tag_id, 12);
  const int a = before.tag_at(2), b = state.tag_at(1);
  EXPECT_EQ((state.P().block<6, 6>(b, b)), (before.P().block<6, 6>(a, a)));
  EXPECT_EQ((state.P().block<6, 6>(0, b)), (before.P().block<6, 6>(0, a)));
}

}  // namespace
}  // namespace fiducap::robocentric
