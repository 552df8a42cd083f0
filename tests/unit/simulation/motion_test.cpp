#include "simulation/motion/motion.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "base/pose.hpp"
#include "robot.hpp"
#include "simulation/random.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap::simulation {
namespace {

// Central differences with a step of 1e-4: the cubic error term and rounding are below this.
constexpr double kDifferences = 2e-6;

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

void expect_derivatives(const PoseSpline& spline, double s) {
  SCOPED_TRACE(s);
  constexpr double kStep = 1e-4;
  const PoseSpline::Point before = spline.at(s - kStep);
  const PoseSpline::Point here = spline.at(s);
  const PoseSpline::Point after = spline.at(s + kStep);
  EXPECT_LT(((after.X.p - before.X.p) / (2 * kStep) - here.velocity).norm(), kDifferences);
  EXPECT_LT(((after.velocity - before.velocity) / (2 * kStep) - here.acceleration).norm(),
            kDifferences);
  const Eigen::Vector3d turned = log_so3(before.X.q.conjugate() * after.X.q);
  EXPECT_LT((turned / (2 * kStep) - here.rate).norm(), kDifferences);
}

TEST(PoseSpline, HasExactDerivativesAlsoWhereTheRoundCloses) {
  const PoseSpline spline(one_round(), 0.7, true);
  for (double s = 0.05; s < 1.2 * spline.length(); s += 0.173) expect_derivatives(spline, s);
  for (const double s : {0.0, 1e-5, spline.length() - 1e-5, spline.length(), 3 * spline.length()})
    expect_derivatives(spline, s);
}

TEST(PoseSpline, RepeatsWhenClosed) {
  const PoseSpline spline(one_round(), 0.7, true);
  const PoseSpline::Point first = spline.at(1.3);
  const PoseSpline::Point later = spline.at(1.3 + 5 * spline.length());
  constexpr double kRounding = 1e-12;
  EXPECT_LT((first.X.p - later.X.p).norm(), kRounding);
  EXPECT_LT(angle_between(first.X.q, later.X.q), 1e-7);  // acos of a number next to 1
}

TEST(PoseSpline, HasWeightsThatAddUpToOne) {
  for (double u = 0; u <= 1.0; u += 0.125) {
    EXPECT_NEAR(PoseSpline::weights(u, 0).sum(), 1.0, 1e-14);
    EXPECT_NEAR(PoseSpline::weights(u, 1).sum(), 0.0, 1e-14);
    EXPECT_NEAR(PoseSpline::weights(u, 2).sum(), 0.0, 1e-14);
    EXPECT_GT(PoseSpline::weights(u, 0).minCoeff(), -1e-15);
  }
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

TEST_F(PoseFile, NamesTheLineOfDamage) {
  const std::string good = tum(1, 0);
  for (const std::string bad :
       {"1600000009 1 2 3\n", "1600000009 nan 2 3 0 0 0 1\n", "1600000009 1 2 3 0 0 0 2\n",
        "1599999999.0 1 2 3 0 0 0 1\n", "garbage\n", "99999999999999999999 1 2 3 0 0 0 1\n"}) {
    const auto poses = read_pose_file(write(good + bad));
    ASSERT_FALSE(poses.has_value()) << bad;
    EXPECT_THAT(poses.error().context, testing::HasSubstr(":103"));
  }
}

TEST_F(PoseFile, RefusesAMissingOrShortFile) {
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

}  // namespace
}  // namespace fiducap::simulation
