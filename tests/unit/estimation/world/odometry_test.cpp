// A step by odometry against central differences.
#include <gtest/gtest.h>

#include <array>

#include "estimation/world/propagation.hpp"
#include "support/jacobian_check.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

using namespace layout;  // NOLINT

const Eigen::Vector3d kGravity_W(0, 0, -9.81);

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
    for (const InertialInput& input : inputs) propagate(state, motion, input, kGravity_W, kStep_s);
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
        const FilterState other = steps.after(moved(before, all), ignored);
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
  // What each number of white noise, held over its step, does to the pose.
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
  const Matrix6d Q = motion.Q.topLeftCorner<6, 6>();
  // As if all of a step's noise came at its end: half a turn of the step is left out.
  EXPECT_LT((Q - expected).cwiseAbs().maxCoeff(), 5e-3 * expected.cwiseAbs().maxCoeff())
      << "got\n"
      << Q << "\nexpected\n"
      << expected;
}

}  // namespace
}  // namespace fiducap::world
