// Every analytic Jacobian of the robocentric filter against central differences, and every change
// of the covariance against the Jacobian of the change of the mean.
#include <gtest/gtest.h>

#include "estimation/robocentric/filter_state.hpp"
#include "estimation/robocentric/motion.hpp"
#include "robocentric/example_state.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap::robocentric {
namespace {

using namespace layout;  // NOLINT

const Eigen::Vector3d kGravity(0, 0, -9.81);
// First order covariances against central differences of the means, relative to the largest entry.
constexpr double kCovarianceTolerance = 1e-6;

FilterState moved(const FilterState& state, const Eigen::VectorXd& error) {
  FilterState out = state;
  out.add_error(error);
  return out;
}

/// Checks that `change` transforms P with the Jacobian of its own mean (no noise).
template <typename Change>
void expect_covariance_follows_mean(const Change& change, const Eigen::MatrixXd& added_noise = {}) {
  const FilterState before = example_state();
  FilterState after = before;
  change(after);
  const Eigen::MatrixXd J = central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        FilterState other = moved(before, d);
        change(other);
        return after.error_to(other);
      },
      before.size());
  Eigen::MatrixXd expected = J * before.P() * J.transpose();
  if (added_noise.size() > 0) expected += added_noise;
  const Eigen::MatrixXd got = after.P();
  EXPECT_LT((got - expected).cwiseAbs().maxCoeff(),
            kCovarianceTolerance * expected.cwiseAbs().maxCoeff())
      << "got\n"
      << got << "\nexpected\n"
      << expected;
  EXPECT_LT((got - got.transpose()).cwiseAbs().maxCoeff(), 1e-12);
}

InertialInput example_input(bool has_accelerometer) {
  InertialInput input;
  input.w_B = {0.8, -1.2, 0.5};
  input.f_B = {1.0, -2.0, 9.0};
  input.has_accelerometer = has_accelerometer;
  return input;
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

TEST(FrameTransition, CovarianceFollowsTheMean) {
  expect_covariance_follows_mean([](FilterState& state) {
    MotionSinceImage motion;
    for (int i = 0; i < 10; ++i) propagate(state, motion, example_input(true), kGravity, 0.005);
    FrameTransition transition;
    transition.apply(state, motion);
  });
}

TEST(FrameTransition, KeepsTagsInTheWorkspace) {
  FilterState state = example_state();
  std::vector<Pose> before;
  for (std::size_t i = 0; i < state.tags.size(); ++i)
    before.push_back(tag_in_workspace(state, i).X_WT);
  MotionSinceImage motion;
  for (int i = 0; i < 50; ++i) propagate(state, motion, example_input(true), kGravity, 0.005);
  FrameTransition transition;
  transition.apply(state, motion);
  constexpr double kRounding = 1e-10;
  for (std::size_t i = 0; i < state.tags.size(); ++i) {
    const Pose after = tag_in_workspace(state, i).X_WT;
    EXPECT_LT((after.p - before[i].p).norm(), kRounding);
    EXPECT_LT(angle_between(after.q, before[i].q), 1e-9);
  }
}

class MeasurementJacobian : public testing::TestWithParam<std::tuple<int, bool>> {};

TEST_P(MeasurementJacobian, MatchesDifferences) {
  const int camera = std::get<0>(GetParam());
  const bool is_known = std::get<1>(GetParam());
  const FilterState state = example_state();
  const CameraModel model = example_camera();
  const KnownTag known{11, 0.2, tag_in_workspace(state, 1).X_WT, Matrix6d::Zero()};
  TagObservation seen;
  seen.edge_m = 0.2;
  const TagToUse use{&seen, is_known ? -1 : 1, is_known ? &known : nullptr};
  seen = example_observation(11, 0.2, predicted_tag(state, camera, use), model);

  const TagMeasurement m = measure(state, camera, model, use, 0.4);
  ASSERT_TRUE(m.in_front);
  EXPECT_LT(m.y.norm(), 1e-9);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(8, state.size());
  for (std::size_t b = 0; b < m.block_count; ++b) H.middleCols<3>(m.blocks[b].at) += m.blocks[b].H;
  expect_jacobian(-H, [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    return measure(moved(state, d), camera, model, use, 0.4).y;
  });
}

INSTANTIATE_TEST_SUITE_P(CamerasAndKinds, MeasurementJacobian,
                         testing::Combine(testing::Values(0, 1), testing::Bool()));

TEST(Measurement, IncludesTheUncertaintyOfAKnownPose) {
  const FilterState state = example_state();
  const CameraModel model = example_camera();
  KnownTag known{11, 0.2, tag_in_workspace(state, 1).X_WT, Matrix6d::Zero()};
  TagObservation seen;
  seen.edge_m = 0.2;
  const TagToUse use{&seen, -1, &known};
  seen = example_observation(11, 0.2, predicted_tag(state, 0, use), model);
  known.covariance.diagonal() << 1e-4, 4e-4, 9e-4, 1e-3, 2e-3, 3e-3;
  const Eigen::MatrixXd J = central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        KnownTag other = known;
        other.X_WT.p += d.head<3>();
        other.X_WT.q = exp_so3(d.tail<3>()) * other.X_WT.q;
        return measure(state, 0, model, {&seen, -1, &other}, 0.4).y;
      },
      6);
  const Eigen::MatrixXd expected =
      J * known.covariance * J.transpose() + 0.16 * Eigen::Matrix<double, 8, 8>::Identity();
  const Eigen::MatrixXd got = measure(state, 0, model, use, 0.4).R;
  EXPECT_LT((got - expected).cwiseAbs().maxCoeff(), 1e-5 * expected.cwiseAbs().maxCoeff());
}

TEST(WorkspaceAxes, TyingToTheReferenceTransformsTheCovariance) {
  for (const bool level : {true, false}) {
    HeadingRule rule;
    rule.axis = 1;
    rule.yaw_rad = 0.3;
    rule.X_WT = {exp_so3({0.2, 0.1, -0.4}), {3, -2, 1}};
    expect_covariance_follows_mean(
        [&](FilterState& state) { anchor_to_reference(state, 1, rule, level); });
  }
}

TEST(WorkspaceAxes, TheReferenceTagIsAtItsDefinedPose) {
  FilterState state = example_state();
  const double tilt_before = (state.q_WB.conjugate() * Eigen::Vector3d::UnitZ()).z();
  WorkspaceGauge gauge;
  gauge.X_WT = Pose{exp_so3({1.2, 0.1, -0.4}), {3, -2, 1}};
  const HeadingRule rule = make_heading_rule(gauge, state.q_WB);
  const Pose before = state.X_WB();
  const Pose shift = anchor_to_reference(state, 2, rule, true);
  const KnownTag tag = tag_in_workspace(state, 2);
  EXPECT_LT((tag.X_WT.p - gauge.X_WT->p).norm(), 1e-9);
  const Eigen::Vector3d axis = tag.X_WT.q * Eigen::Vector3d::Unit(rule.axis);
  EXPECT_NEAR(std::atan2(axis.y(), axis.x()), rule.yaw_rad, 1e-9);
  EXPECT_NEAR((state.q_WB.conjugate() * Eigen::Vector3d::UnitZ()).z(), tilt_before, 1e-9)
      << "up must stay up";
  // By definition exact: position variance of the reference tag is gone.
  EXPECT_LT(tag.covariance.topLeftCorner(3, 3).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT(((shift * before).p - state.X_WB().p).norm(), 1e-9);
}

TEST(WorkspaceAxes, TyingAgainChangesNothing) {
  FilterState state = example_state();
  const HeadingRule rule = make_heading_rule({}, state.q_WB);
  anchor_to_reference(state, 0, rule, true);
  const FilterState once = state;
  anchor_to_reference(state, 0, rule, true);
  EXPECT_LT(once.error_to(state).norm(), 1e-9);
  EXPECT_LT((once.P() - state.P()).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(TagAugmentation, ASecondCamerasTagCarriesBothExtrinsics) {
  const CameraModel model = example_camera();
  const FilterState before = example_state();
  const Pose X_V1T{exp_so3({3.0, 0.2, 0.1}), {0.1, 0.05, 1.2}};
  const TagObservation seen = example_observation(42, 0.2, X_V1T, model);
  FilterState after = before;
  augment(after, 1, model, seen, X_V1T, 0.4);
  const Eigen::MatrixXd J = central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        FilterState other = moved(before, d);
        augment(other, 1, model, seen, X_V1T, 0.4);
        return after.error_to(other);
      },
      before.size());
  const CornerResidual r = corner_residual(seen, X_V1T, model);
  Eigen::MatrixXd expected = J * before.P() * J.transpose();
  const Pose X_V0V1 = before.X_BV[0].inverse() * before.X_BV[1];
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = X_V0V1.rotation();
  turn.bottomRightCorner<3, 3>() = X_V0V1.rotation();
  const Matrix6d information = r.H.transpose() * r.H / 0.16;
  expected.bottomRightCorner<6, 6>() += turn * information.inverse() * turn.transpose();
  EXPECT_LT((after.P() - expected).cwiseAbs().maxCoeff(),
            kCovarianceTolerance * expected.cwiseAbs().maxCoeff());
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
