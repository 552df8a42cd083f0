#include <gtest/gtest.h>

#include <algorithm>

#include "base/pose.hpp"
#include "robot.hpp"
#include "simulation/room_shape.hpp"

namespace fiducap::simulation {
namespace {

// Steps of 1e-4 s: the next term, jerk · step² / 6, is below this for every kind.
constexpr double kDifferences = 3e-6;

RoomConfig room_for(const std::string& kind) {
  return room_of(kind == "survey" || kind == "hover" ? "hall" : kind);
}

class TrajectoryOfKind : public testing::TestWithParam<std::string> {
 protected:
  [[nodiscard]] static std::unique_ptr<Trajectory> make(std::uint64_t seed = 1,
                                                        double speed = 1.0) {
    TrajectoryConfig config;
    config.kind = GetParam();
    config.seed = seed;
    config.speed = speed;
    return make_trajectory(config, room_for(config.kind), corner_robot("").cameras[0].X_BV).value();
  }
};

TEST_P(TrajectoryOfKind, VelocityAccelerationAndRateAreExact) {
  for (const double speed : {1.0, 1.7}) {
    const auto trajectory = make(3, speed);
    for (double t = 0.31; t < 200; t += 1.377) {
      constexpr double kStep = 1e-4;
      const Trajectory::Point before = trajectory->at(t - kStep);
      const Trajectory::Point here = trajectory->at(t);
      const Trajectory::Point after = trajectory->at(t + kStep);
      SCOPED_TRACE(t);
      ASSERT_LT(((after.X_WB.p - before.X_WB.p) / (2 * kStep) - here.v_WB).norm(), kDifferences);
      ASSERT_LT(((after.v_WB - before.v_WB) / (2 * kStep) - here.a_WB).norm(), kDifferences);
      const Eigen::Vector3d turned = log_so3(before.X_WB.q.conjugate() * after.X_WB.q);
      ASSERT_LT((turned / (2 * kStep) - here.w_WB_B).norm(), kDifferences);
    }
  }
}

TEST_P(TrajectoryOfKind, RestsForOneSecondThenMoves) {
  const auto trajectory = make();
  const Trajectory::Point start = trajectory->at(0);
  for (const double t : {0.0, 0.5, 1.0}) {
    const Trajectory::Point here = trajectory->at(t);
    EXPECT_EQ(here.v_WB.norm() + here.a_WB.norm() + here.w_WB_B.norm(), 0.0);
    EXPECT_EQ((here.X_WB.p - start.X_WB.p).norm(), 0.0);
  }
  EXPECT_GT(trajectory->at(3.5).v_WB.norm() + trajectory->at(3.5).w_WB_B.norm(), 1e-3);
}

TEST_P(TrajectoryOfKind, HasAContinuousJerk) {
  const auto trajectory = make(2);
  constexpr double kStep = 1e-3;
  // A step would be 1 m/s³ and more; a smooth jerk changes by snap · step.
  constexpr double kLargestChange = 0.25;
  const auto jerk = [&](double t) -> Eigen::Vector3d {
    return (trajectory->at(t + kStep / 2).a_WB - trajectory->at(t - kStep / 2).a_WB) / kStep;
  };
  Eigen::Vector3d last = jerk(0.5);
  for (double t = 0.5 + kStep; t < 20; t += kStep) {
    const Eigen::Vector3d now = jerk(t);
    ASSERT_LT((now - last).norm(), kLargestChange) << "at " << t;
    last = now;
  }
}

TEST_P(TrajectoryOfKind, DiffersBySeed) {
  const auto one = make(1);
  const auto other = make(2);
  double apart = 0;
  for (double t = 0; t < 60; t += 0.5)
    apart = std::max(apart, (one->at(t).X_WB.p - other->at(t).X_WB.p).norm());
  EXPECT_GT(apart, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Kinds, TrajectoryOfKind,
                         testing::Values("survey", "hover", "table", "sparse", "loop", "ceiling"),
                         [](const auto& kind) { return kind.param; });

TEST(Trajectory, SurveyStaysInTheHallAtAModestPace) {
  const RoomConfig room = room_of("hall");
  const RoomBox box = box_of(room);
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    TrajectoryConfig config;
    config.seed = seed;
    const auto trajectory = make_trajectory(config, room).value();
    for (double t = 0; t < 120; t += 0.1) {
      const Trajectory::Point here = trajectory->at(t);
      constexpr double kFromWall_m = 0.2;
      ASSERT_GT((here.X_WB.p - box.low).minCoeff(), kFromWall_m) << "seed " << seed;
      ASSERT_GT((box.high - here.X_WB.p).minCoeff(), kFromWall_m) << "seed " << seed;
      ASSERT_LE(here.v_WB.norm(), 1.0);
      ASSERT_LE(here.w_WB_B.norm(), 1.0);
    }
  }
}

TEST(Trajectory, AimsTheCameraForEveryMount) {
  const RoomConfig room = room_of("hall");
  const Pose forward = forward_camera();
  const Pose upward{exp_so3({0.02, 0.01, 1.6}), {0.0, 0.0, 0.0}};
  const auto a = make_trajectory({}, room, forward).value();
  const auto b = make_trajectory({}, room, upward).value();
  for (double t = 0; t < 30; t += 1.1)
    EXPECT_LT(angle_between(a->at(t).X_WB.q * forward.q, b->at(t).X_WB.q * upward.q), 1e-6);
}

TEST(Trajectory, HasTheSameMotionPerSeedWithEveryCompiler) {
  // From a GCC build; Clang evaluates arguments in another order, and demos, scores and bug reports
  // name seeds. Change these numbers only when the motion shall change.
  const std::vector<std::pair<std::string, Eigen::Vector3d>> after_20_s{
      {"survey", {2.102815, -1.024579, 1.019457}}, {"hover", {-2.919340, -3.378057, 1.508900}},
      {"table", {0.081157, -0.070668, 0.857476}},  {"sparse", {0.343124, -0.326863, 1.647574}},
      {"loop", {17.072799, 6.235383, 3.360563}},   {"ceiling", {-1.474402, 0.633703, 0.887882}}};
  for (const auto& [kind, p_WB] : after_20_s) {
    TrajectoryConfig config;
    config.kind = kind;
    config.seed = 5;
    const auto trajectory = make_trajectory(config, room_for(kind)).value();
    EXPECT_LT((trajectory->at(20).X_WB.p - p_WB).norm(), 2e-6) << kind;
  }
}

TEST(Trajectory, RefusesUnknownKindsAndRoomsWithoutTags) {
  TrajectoryConfig config;
  config.kind = "teleport";
  EXPECT_FALSE(make_trajectory(config, room_of("hall")).has_value());
  EXPECT_FALSE(make_trajectory({}, room_of("custom")).has_value());
}

}  // namespace
}  // namespace fiducap::simulation
