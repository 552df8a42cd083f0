// Every analytic Jacobian of the world filter against central differences, and every change of the
// covariance against the Jacobian of the change of the mean.
#include <gtest/gtest.h>

#include <array>

#include "base/pose.hpp"
#include "covariance_check.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/propagation.hpp"
#include "estimation/world/tag_entry.hpp"
#include "estimation/world/workspace_axes.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

using namespace layout;  // NOLINT

const Eigen::Vector3d kGravity(0, 0, -9.81);

class WorldStepJacobian : public testing::TestWithParam<bool> {};

TEST_P(WorldStepJacobian, MatchesDifferences) {
  const InertialInput input = example_input(GetParam());
  for (const double dt : {1e-6, 0.005, 0.05}) {
    FilterState mean = example_state();
    const StepJacobians jacobians = step_mean(mean, input, kGravity, dt);
    const auto f = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      Eigen::VectorXd error = Eigen::VectorXd::Zero(mean.size());
      error.head<kBodySize>() = d;
      FilterState state = with_error(example_state(), error);
      step_mean(state, input, kGravity, dt);
      return mean.error_to(state).head<kBodySize>();
    };
    // The force is turned by half the rotation, whose Jacobian is taken to first order in w dt.
    expect_jacobian(jacobians.F, f, dt < 0.01 ? 1e-6 : 2e-4);
  }
}

TEST(WorldMotion, MatchesDifferencesByParameters) {
  FilterState start = example_state();
  start.imu = {
      {0.01, -0.02, 0.015}, {0.02, -0.01, 0.03}, {-0.01, 0.02, 0.005}, {0.01, 0.02, -0.03}};
  const auto move = [](FilterState& state) {
    MotionSinceImage motion;
    for (int i = 0; i < 100; ++i) propagate(state, motion, example_input(true), kGravity, 0.002);
    return motion;
  };
  FilterState mean = start;
  const MotionSinceImage motion = move(mean);
  const Eigen::Vector3d drifted = start.bias_w + motion.seconds * start.imu.gyro_drift;
  EXPECT_LT((mean.bias_w - drifted).norm(), 1e-12);
  expect_jacobian(
      motion.by_parameters,
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        Eigen::VectorXd error = Eigen::VectorXd::Zero(mean.size());
        error.segment<kMotionSize>(gravity(mean.cameras())) = d;
        FilterState state = with_error(start, error);
        move(state);
        return mean.error_to(state).head<kBiasF>();
      },
      1e-4);
}

TEST(WorldMotion, KeepsTheStationaryVarianceOfTheDrift) {
  FilterState state = example_state();
  state.gyro_drift_sigma = 2e-3;
  const int at = gyro_drift(state.cameras());
  state.clear_column(at, state.gyro_drift_sigma);
  state.imu.gyro_drift = {0, 1e-3, 0};
  MotionSinceImage motion;
  for (int second = 0; second < 600; ++second) {
    propagate(state, motion, example_input(true), kGravity, 1.0);
    apply(state, motion);
  }
  EXPECT_NEAR(state.P()(at, at), 4e-6, 1e-12);
  EXPECT_NEAR(state.imu.gyro_drift.y(), 1e-3 * std::exp(-1.0), 1e-9);
}

TEST_P(WorldStepJacobian, MapsAShiftOfTheRoomOntoItself) {
  FilterState state = example_state();
  const StepJacobians jacobians = step_mean(state, example_input(GetParam()), kGravity, 0.02);
  Eigen::Matrix<double, kBodySize, 4> room = Eigen::Matrix<double, kBodySize, 4>::Zero();
  room.block<3, 3>(kPosition, 0).setIdentity();
  room(kAttitude + 2, 3) = 1;
  EXPECT_LT((jacobians.F * room - room).norm(), 1e-12);
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutAccelerometer, WorldStepJacobian, testing::Bool());

TEST(WorldTransition, CovarianceFollowsTheMean) {
  expect_covariance_follows_mean<FilterState>(example_state(), [](FilterState& state) {
    MotionSinceImage motion;
    for (int i = 0; i < 10; ++i) propagate(state, motion, example_input(true), kGravity, 0.005);
    apply(state, motion);
  });
}

class WorldMeasurement : public testing::TestWithParam<std::tuple<int, bool>> {
 protected:
  /// A tag in view of one of two cameras, in the state or known, and its Jacobian over the whole
  /// state.
  Eigen::MatrixXd jacobian(const FilterState& state) {
    const auto [camera, is_known] = GetParam();
    use_ = {&seen_, is_known ? -1 : 1, is_known ? &known_ : nullptr};
    const Pose X_VT =
        (state.X_WB * state.X_BV[static_cast<std::size_t>(camera)]).inverse() * state.tags[1].X_WT;
    seen_ = example_observation(11, 0.2, X_VT, model_);
    seen_.rows = {0.4, 0.35, -0.3, -0.2};
    const TagMeasurement m = measure(state, camera, model_, use_, white_);
    EXPECT_TRUE(m.in_front);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(8, state.size());
    for (std::size_t b = 0; b < m.block_count; ++b)
      H.middleCols<3>(m.blocks[b].at) += m.blocks[b].H;
    return H;
  }

  CornerNoise white_{EstimatorConfig{}, false};
  CameraModel model_ = example_camera();
  KnownTag known_{11, 0.2, example_state().tags[1].X_WT, Matrix6d::Zero()};
  TagObservation seen_;
  TagToUse use_;
};

TEST_P(WorldMeasurement, MatchesDifferences) {
  FilterState state = example_state();
  state.lenses[0] = {0.01, {2.0, -1.0}, -0.06};
  state.lenses[1] = {-0.02, {0.5, 3.0}, 0.04};
  state.sizes.common = 0.02;
  state.sizes.watched[1].scale = -0.01;
  const Eigen::MatrixXd H = jacobian(state);
  const int camera = std::get<0>(GetParam());
  expect_jacobian(-H, [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    return measure(with_error(state, d), camera, model_, use_, white_).y;
  });
}

TEST_P(WorldMeasurement, HasMoreNoiseOffTheAxisOfALensWithWrongDistortion) {
  FilterState state = example_state();
  (void)jacobian(state);  // shows a tag
  const int camera = std::get<0>(GetParam());
  state.P()(layout::focal(camera), layout::focal(camera)) = 0;
  const double configured = measure(state, camera, model_, use_, white_).noise_px;
  state.lenses[static_cast<std::size_t>(camera)].k1 = -0.3;
  const TagMeasurement bent = measure(state, camera, model_, use_, white_);
  double radius = 0;
  for (const Eigen::Vector2d& px : seen_.raw_px)
    radius += 0.25 * (px - Eigen::Vector2d(model_.cu, model_.cv)).norm() / model_.fu;
  const double rest = 1.5 * 0.09 * std::pow(radius, 5) * model_.fu;  // a second coefficient's
  EXPECT_NEAR(bent.noise_px, std::hypot(configured, rest), 1e-9);
  EXPECT_GT(bent.noise_px, configured);
}

TEST_P(WorldMeasurement, DoesNotObserveAShiftOfTheRoom) {
  if (std::get<1>(GetParam())) return;  // a known tag determines the room's pose: its purpose
  const FilterState state = example_state();
  const Eigen::MatrixXd H = jacobian(state);
  Eigen::MatrixXd room = Eigen::MatrixXd::Zero(state.size(), 6);
  room.middleRows<6>(kPosition).setIdentity();
  for (int c = 0; c < state.cameras(); ++c) room.middleRows<6>(layout::camera(c)).setIdentity();
  for (std::size_t i = 0; i < state.tags.size(); ++i)
    room.middleRows<6>(state.tag_at(i)).setIdentity();
  EXPECT_LT((H * room).norm(), 1e-12 * H.norm());
}

INSTANTIATE_TEST_SUITE_P(CamerasAndKinds, WorldMeasurement,
                         testing::Combine(testing::Values(0, 1), testing::Bool()));

/// Covariance of point `at` (mean p), seen from camera c; W axes.
Eigen::Matrix3d seen_from_camera(const FilterState& state, int c, int at,
                                 const Eigen::Vector3d& p) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(3, state.size());
  A.middleCols<3>(at) += Eigen::Matrix3d::Identity();
  A.middleCols<3>(at + 3) -= skew(p);
  A.middleCols<3>(layout::camera(c)) -= Eigen::Matrix3d::Identity();
  A.middleCols<3>(layout::camera(c) + 3) += skew(p);
  return propagated(A, state.P());
}

TEST(WorldCorrection, KeepsTheInformationAboutRelativePositions) {
  for (int camera = 0; camera < 2; ++camera) {
    const FilterState before = example_state();
    FilterState after = before;
    const Eigen::VectorXd correction = 0.2 * Eigen::VectorXd::LinSpaced(before.size(), -1, 1.3);
    after.add_error(correction);
    transport_covariance(after, correction, camera);

    EXPECT_LT((after.P() - after.P().transpose()).norm(), 1e-12 * after.P().norm());
    const auto expect_same = [&](int at, const Eigen::Vector3d& p_before,
                                 const Eigen::Vector3d& p_after) {
      const Eigen::Matrix3d known = seen_from_camera(before, camera, at, p_before);
      EXPECT_LT((seen_from_camera(after, camera, at, p_after) - known).norm(),
                1e-11 * known.norm());
      // … which without the transport would be wrong.
      EXPECT_GT((seen_from_camera(before, camera, at, p_after) - known).norm(),
                1e-2 * known.norm());
    };
    expect_same(layout::kPosition, before.X_WB.p, after.X_WB.p);
    expect_same(layout::camera(1 - camera), before.X_WV(1 - camera).p, after.X_WV(1 - camera).p);
    for (std::size_t i = 0; i < before.tags.size(); ++i) {
      expect_same(before.tag_at(i), before.tags[i].X_WT.p, after.tags[i].X_WT.p);
    }
  }
}

TEST(WorldAxes, AreThoseOfTheReferenceTag) {
  expect_anchoring<FilterState>(example_state(), [](const FilterState& s) { return s.X_WB; });
  FilterState state = example_state();
  const HeadingRule rule = make_heading_rule({}, state.X_WB.q);
  anchor_to_reference(state, 2, rule, true);
  EXPECT_LT(slack_of_reference(state, 2, rule, true).moved, 1e-9);
  EXPECT_LT(slack_of_reference(state, 2, rule, true).sigma, 1e-6);
}

/// Of a pose, in the plain coordinates of results.
Vector6d plain_error(const Pose& X, const Pose& other) {
  Vector6d plain;
  plain << other.p, log_so3(other.q * X.q.conjugate());
  return plain;
}

TEST(WorldExtrinsics, AreTheErrorsOfTheCameraRelativeToTheBody) {
  const FilterState state = example_state();
  for (int c = 0; c < state.cameras(); ++c) {
    const auto of = [&](const FilterState& s) { return s.X_BV[static_cast<std::size_t>(c)]; };
    const Eigen::MatrixXd expected =
        covariance_of<FilterState>(state, [&](const FilterState& other) -> Eigen::VectorXd {
          return plain_error(of(state), of(other));
        });
    expect_matrices_near(extrinsics_covariance(state, c), expected, kFirstOrder);
  }
}

TEST(WorldExtrinsics, TheTwoFormsOfTheCovarianceAreEquivalent) {
  FilterState state = example_state();
  camera_errors_to_extrinsics(state);
  extrinsics_to_camera_errors(state);
  EXPECT_LT((state.P() - example_state().P()).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(WorldTagEntry, IncludesTheErrorsOfBodyAndExtrinsics) {
  const CameraModel model = example_camera();
  const FilterState before = example_state();
  const Pose X_VT{exp_so3({3.0, 0.2, 0.1}), {0.1, 0.05, 1.2}};
  const TagObservation seen = example_observation(42, 0.2, X_VT, model);
  const auto change = [&](FilterState& state) {
    augment(state, 1, model, seen, X_VT, CornerNoise(EstimatorConfig{}, false));
  };
  FilterState after = before;
  change(after);
  const CornerResidual r = corner_residual(seen, X_VT, model);
  const CornerNoise white(EstimatorConfig{}, false);
  const double noise_px = measure(after, 1, model, {&seen, 3, nullptr}, white).noise_px;
  const Matrix6d own = noise_px * noise_px * inverse(r.H.transpose() * r.H);
  // A rotation of the tag in camera axes, as an error on the world's side.
  const Pose X_WV = before.X_WB_after(before.clocks[1].seconds_to(0)) * before.X_BV[1];
  const Eigen::MatrixXd from_seen = central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        FilterState other = after;
        other.tags.back().X_WT = X_WV * Pose{exp_so3(d.tail<3>()) * X_VT.q, X_VT.p + d.head<3>()};
        return after.error_to(other).tail<6>();
      },
      6);
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(after.size(), after.size());
  noise.bottomRightCorner<6, 6>() = propagated(from_seen, own);
  expect_covariance_follows_mean<FilterState>(before, change, noise);
}

/// ∂ of the corners by the place of the newest tag, W axes.
Matrix86d place_columns(const FilterState& state, int camera, const CameraModel& model,
                        const TagObservation& seen, const CornerNoise& noise) {
  const int local = static_cast<int>(state.tags.size()) - 1;
  const TagMeasurement m = measure(state, camera, model, {&seen, local, nullptr}, noise);
  Matrix86d H = Matrix86d::Zero();
  const int at = state.tag_at(static_cast<std::size_t>(local));
  for (std::size_t b = 0; b < m.block_count; ++b) {
    if (m.blocks[b].at == at) H.leftCols<3>() = m.blocks[b].H;
    if (m.blocks[b].at == at + 3) H.rightCols<3>() = m.blocks[b].H;
  }
  return H;
}

TEST(WorldTagEntry, WeightsEveryCornerByItsSigma) {
  const CameraModel model = example_camera();
  FilterState state = example_state();
  state.P().setZero();  // the tag's own alone
  const Pose X_VT{exp_so3({3.0, 0.2, 0.1}), {0.1, 0.05, 1.2}};
  TagObservation seen = example_observation(42, 0.2, X_VT, model);
  seen.corner_sigma_px = 0.3;
  // Smeared along two of its sides.
  seen.sides = {SideSigma{0.03, 0.05}, {0.6, 0.9}, {0.03, 0.05}, {0.6, 0.9}};
  EstimatorConfig config;
  config.corner_noise_px = 0.01;
  const CornerNoise noise(config, true);
  augment(state, 1, model, seen, X_VT, noise);

  const Matrix86d H = place_columns(state, 1, model, seen, noise);
  const Matrix8d R = noise.covariance(seen, 0.0);
  expect_matrices_near(state.P().bottomRightCorner<6, 6>(),
                       inverse(propagated(H.transpose(), inverse(R))), 1e-6);
}

TEST(WorldTagEntry, AnUninformativePriorChangesNothing) {
  FilterState state = example_state();
  KnownTag prior = tag_in_workspace(state, 1);
  prior.covariance = Matrix6d::Identity() * 1e12;
  const FilterState before = state;
  fuse_prior(state, 1, prior);
  EXPECT_LT(before.error_to(state).norm(), 1e-9);
  EXPECT_LT((before.P() - state.P()).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(WorldTagEntry, AnExactPriorDefinesTheTagPose) {
  FilterState state = example_state();
  state.P() *= 1e-4;
  KnownTag prior = tag_in_workspace(state, 1);
  prior.X_WT.p += Eigen::Vector3d(0.01, -0.02, 0.005);
  prior.covariance = Matrix6d::Identity() * 1e-14;
  fuse_prior(state, 1, prior);
  const KnownTag after = tag_in_workspace(state, 1);
  EXPECT_LT((after.X_WT.p - prior.X_WT.p).norm(), 1e-6);
  EXPECT_LT(angle_between(after.X_WT.q, prior.X_WT.q), 1e-6);
  EXPECT_LT(after.covariance.cwiseAbs().maxCoeff(), 1e-9);
}

TEST(WorldOutput, CovariancesAreThoseOfThePlainErrors) {
  const FilterState state = example_state();
  const Eigen::MatrixXd expected =
      covariance_of<FilterState>(state, [&](const FilterState& other) -> Eigen::VectorXd {
        Eigen::VectorXd plain(15);
        plain << plain_error(state.X_WB, other.X_WB), other.v_WB, other.bias_f, other.bias_w;
        return plain;
      });
  expect_matrices_near(body_in_workspace(state).covariance, expected, kFirstOrder);
}

/// Pose of a body after two steps of odometry.
struct OdometrySteps {
  std::array<InertialInput, 2> inputs;
  OdometrySteps() {
    for (InertialInput& input : inputs) {
      input.has_accelerometer = false;
      input.velocity_noise = 0.03;
      input.gyro_noise = 0.02;
    }
    inputs[0].w_B = {0.3, -0.2, 0.5};
    inputs[0].v_B = {1.0, 0.2, -0.3};
    inputs[1].w_B = {-0.1, 0.4, 0.2};
    inputs[1].v_B = {0.5, -0.6, 0.1};
  }
  FilterState after(FilterState state, MotionSinceImage& motion) const {
    for (const InertialInput& input : inputs) propagate(state, motion, input, kGravity, kStep_s);
    return state;
  }
  static constexpr double kStep_s = 0.01;
};

TEST(WorldOdometry, AnEarlierErrorStaysAndTheVelocityIsThatOfOdometry) {
  const OdometrySteps steps;
  const FilterState before = example_state();
  MotionSinceImage motion;
  const FilterState after = steps.after(before, motion);
  const Eigen::MatrixXd Phi = central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        Eigen::VectorXd all = Eigen::VectorXd::Zero(before.size());
        all.head<kBodySize>() = d;
        MotionSinceImage ignored;
        const FilterState other = steps.after(with_error(before, all), ignored);
        return after.error_to(other).head<kBodySize>();
      },
      kBodySize);
  EXPECT_LT((motion.Phi - Phi).cwiseAbs().maxCoeff(), 1e-6) << Phi;
  EXPECT_LT((after.v_WB - after.X_WB.q * *steps.inputs[1].v_B).norm(), 0.01);
}

TEST(WorldOdometry, ItsNoiseIsInBodyAxes) {
  const OdometrySteps steps;
  MotionSinceImage motion;
  const FilterState after = steps.after(example_state(), motion);
  // Effect of each number of white noise, constant over its step, on the pose.
  Matrix6d expected = Matrix6d::Zero();
  for (std::size_t step = 0; step < steps.inputs.size(); ++step) {
    const Eigen::MatrixXd G = central_differences(
        [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
          OdometrySteps other = steps;
          *other.inputs[step].v_B += d.head<3>() * 0.03;
          other.inputs[step].w_B += d.tail<3>() * 0.02;
          MotionSinceImage ignored;
          return after.error_to(other.after(example_state(), ignored)).head<6>();
        },
        6);
    expected += G * G.transpose() / OdometrySteps::kStep_s;
  }
  // The noise of a step is added at its end: half of the step's rotation is left out.
  expect_matrices_near(motion.Q.topLeftCorner<6, 6>(), expected, 5e-3);
}

}  // namespace
}  // namespace fiducap::world
