#include "simulation/motion/motion.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "base/pose.hpp"
#include "robot.hpp"
#include "simulation/random.hpp"
#include "simulation/room_shape.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap::simulation {
namespace {

/// One round with a full turn about z, so that q comes back as −q.
std::vector<Pose> one_round() {
  Random random(7, Purpose::kMotion);
  std::vector<Pose> poses;
  for (int i = 0; i < 12; ++i) {
    const double turn = 2 * std::numbers::pi * i / 12;
    const Eigen::Vector3d p =
        Eigen::Vector3d(std::cos(turn), std::sin(turn), 0) + 0.2 * random.normal3();
    poses.push_back({exp_so3({0, 0, turn}) * exp_so3(0.1 * random.normal3()), p});
  }
  return poses;
}

/// Velocity, acceleration and rate of `at` against central differences.
void expect_derivatives(const std::function<Trajectory::Point(double)>& at, double t,
                        double tolerance) {
  SCOPED_TRACE(t);
  constexpr double kStep = 1e-4;
  const Trajectory::Point before = at(t - kStep);
  const Trajectory::Point here = at(t);
  const Trajectory::Point after = at(t + kStep);
  ASSERT_LT(((after.X_WB.p - before.X_WB.p) / (2 * kStep) - here.v_WB).norm(), tolerance);
  ASSERT_LT(((after.v_WB - before.v_WB) / (2 * kStep) - here.a_WB).norm(), tolerance);
  const Eigen::Vector3d turned = log_so3(before.X_WB.q.conjugate() * after.X_WB.q);
  ASSERT_LT((turned / (2 * kStep) - here.w_WB_B).norm(), tolerance);
}

TEST(PoseSpline, HasExactDerivativesAlsoWhereTheRoundClosesAndRepeats) {
  constexpr double kDifferences = 2e-6;  // the cubic error term and rounding are below
  const PoseSpline spline(one_round(), 0.7, true);
  const double length = spline.length();
  std::vector<double> places{0.0, 1e-5, length - 1e-5, length, 3 * length};
  for (double s = 0.05; s < 1.2 * length; s += 0.173) places.push_back(s);
  const auto at = [&](double s) -> Trajectory::Point {
    const PoseSpline::Point point = spline.at(s);
    return {point.X, point.velocity, point.acceleration, point.rate};
  };
  for (const double s : places) expect_derivatives(at, s, kDifferences);
  const Pose later = at(1.3 + 5 * length).X_WB;
  EXPECT_LT((at(1.3).X_WB.p - later.p).norm(), 1e-12);
  EXPECT_LT(angle_between(at(1.3).X_WB.q, later.q), 1e-7);  // acos of a number next to 1
}

TEST(PoseSpline, StandsStillAtEqualControlPoses) {
  const Pose here{exp_so3({0.1, 0.2, 0.3}), {1, 2, 3}};
  const PoseSpline spline(std::vector<Pose>(8, here), 0.5, false);
  const PoseSpline::Point point = spline.at(0.61);
  EXPECT_LT((point.X.p - here.p).norm(), 1e-13);
  EXPECT_LT(point.velocity.norm() + point.acceleration.norm() + point.rate.norm(), 1e-12);
}

class PoseFile : public testing::Test {
 protected:
  std::string write(const std::string& text) { return folder_.write("poses.txt", text); }
  static Pose pose_at(double t) {
    return {exp_so3({0.3 * std::sin(0.9 * t), 0.2 * std::cos(0.7 * t), 0.4 * t}),
            {std::sin(t), std::cos(0.8 * t), 0.1 * t}};
  }
  /// 100 Hz, 1 mm and 1 mrad of noise when wanted.
  static std::string tum(double length_s, double noise) {
    Random random(1, Purpose::kMotion);
    std::string text = "# timestamp tx ty tz qx qy qz qw\n";
    for (int k = 0; k <= static_cast<int>(length_s * 100); ++k) {
      Pose X = pose_at(0.01 * k);
      X.p += noise * random.normal3();
      X.q = (X.q * exp_so3(noise * random.normal3())).normalized();
      char line[256];
      std::snprintf(line, sizeof(line), "%d.%02d %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n",
                    1600000000 + k / 100, k % 100, X.p.x(), X.p.y(), X.p.z(), X.q.x(), X.q.y(),
                    X.q.z(), X.q.w());
      text += line;
    }
    return text;
  }
  TemporaryFolder folder_;
};

TEST_F(PoseFile, FitsASmoothMotionToTumPoses) {
  const auto poses = value_of(read_pose_file(write(tum(10, 0))));
  ASSERT_EQ(poses.size(), 1001u);
  EXPECT_NEAR(poses.back().t_s, 10.0, 1e-9);
  const PoseSpline spline = fit_spline(poses);
  constexpr double kFit_m = 2e-4;  // what the penalty costs on a curve with 1 m/s² and 1 s periods
  for (double t = 0.3; t < 9.7; t += 0.137) {
    EXPECT_LT((spline.at(t).X.p - pose_at(t).p).norm(), kFit_m);
    EXPECT_LT(angle_between(spline.at(t).X.q, pose_at(t).q), kFit_m);
  }
}

TEST_F(PoseFile, SmoothsNoise) {
  const PoseSpline spline = fit_spline(value_of(read_pose_file(write(tum(10, 0.001)))));
  // Second differences of the raw file would be √6 · 1 mm / (10 ms)² = 24 m/s².
  constexpr double kWorstAcceleration = 4.0;
  for (double t = 0.5; t < 9.5; t += 0.01) {
    const Eigen::Vector3d exact(-std::sin(t), -0.64 * std::cos(0.8 * t), 0);
    ASSERT_LT((spline.at(t).acceleration - exact).norm(), kWorstAcceleration);
  }
}

TEST_F(PoseFile, ReadsTruthOfEuroc) {
  std::string text = "#timestamp [ns], p_RS_R_x [m], ...\n";
  for (int k = 0; k < 10; ++k)
    text += std::to_string(1600000000000000000 + k * 5000000LL) + ",1,2,3,0.6,0.8,0,0,9,9,9\n";
  const auto poses = value_of(read_pose_file(write(text)));
  EXPECT_NEAR(poses[1].t_s, 0.005, 1e-12);
  EXPECT_NEAR(poses[1].X_WB.q.w(), 0.6, 1e-12);
  EXPECT_NEAR(poses[1].X_WB.q.x(), 0.8, 1e-12);
}

TEST_F(PoseFile, RefusesAMissingOrShortFileAndNamesTheLineOfDamage) {
  const std::string good = tum(1, 0);
  for (const std::string bad :
       {"1600000009 1 2 3\n", "1600000009 nan 2 3 0 0 0 1\n", "1600000009 1 2 3 0 0 0 2\n",
        "1599999999.0 1 2 3 0 0 0 1\n", "garbage\n", "99999999999999999999 1 2 3 0 0 0 1\n"}) {
    const auto poses = read_pose_file(write(good + bad));
    ASSERT_FALSE(poses.has_value()) << bad;
    EXPECT_THAT(poses.error().context, testing::HasSubstr(":103"));
  }
  EXPECT_EQ(read_pose_file(folder_.file("missing")).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(read_pose_file(write("1.0 0 0 0 0 0 0 1\n")).error().code, ErrorCode::kTruncated);
}

TEST_F(PoseFile, IsPlayedBackAndForthWithoutAJump) {
  TrajectoryConfig config;
  config.kind = "file";
  config.file = write(tum(5, 0));
  const auto trajectory = make_trajectory(config, room_of("hall")).value();
  Eigen::Vector3d last = trajectory->at(0).X_WB.p;
  for (double t = 0.01; t < 30; t += 0.01) {
    const Trajectory::Point here = trajectory->at(t);
    ASSERT_LT((here.X_WB.p - last).norm(), 0.02) << "at " << t;  // 2 m/s
    last = here.X_WB.p;
  }
  // One way takes 5 s and a ramp of 2 s: after both ways it is where it began.
  EXPECT_LT((trajectory->at(1 + 14).X_WB.p - trajectory->at(0).X_WB.p).norm(), 1e-9);
}

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
  constexpr double kDifferences = 3e-6;  // jerk · step² / 6 is below it for every kind
  for (const double speed : {1.0, 1.7}) {
    const auto trajectory = make(3, speed);
    const auto at = [&](double t) { return trajectory->at(t); };
    for (double t = 0.31; t < 200; t += 1.377) expect_derivatives(at, t, kDifferences);
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

}  // namespace
}  // namespace fiducap::simulation
