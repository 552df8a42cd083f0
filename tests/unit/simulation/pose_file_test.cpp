#include "simulation/motion/motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "base/pose.hpp"
#include "robot.hpp"
#include "simulation/random.hpp"

namespace fiducap::simulation {
namespace {

class PoseFile : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    path_ =
        std::filesystem::temp_directory_path() / (std::string("fiducap_pose_file_") + test->name());
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::string write(const std::string& text) {
    std::ofstream(path_) << text;
    return path_.string();
  }
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
  std::filesystem::path path_;
};

TEST_F(PoseFile, TumPosesBecomeASmoothMotionThatFollowsThem) {
  const auto poses = read_pose_file(write(tum(10, 0)));
  ASSERT_TRUE(poses.has_value()) << poses.error().text();
  ASSERT_EQ(poses->size(), 1001u);
  EXPECT_NEAR(poses->back().t_s, 10.0, 1e-9);
  const PoseSpline spline = fit_spline(*poses);
  constexpr double kFit_m = 2e-4;  // what the penalty costs on a curve with 1 m/s² and 1 s periods
  for (double t = 0.3; t < 9.7; t += 0.137) {
    EXPECT_LT((spline.at(t).X.p - pose_at(t).p).norm(), kFit_m);
    EXPECT_LT(angle_between(spline.at(t).X.q, pose_at(t).q), kFit_m);
  }
}

TEST_F(PoseFile, NoiseOfTheFileIsSmoothedAway) {
  const auto poses = read_pose_file(write(tum(10, 0.001)));
  ASSERT_TRUE(poses.has_value()) << poses.error().text();
  const PoseSpline spline = fit_spline(*poses);
  // Second differences of the raw file would be √6 · 1 mm / (10 ms)² = 24 m/s².
  constexpr double kWorstAcceleration = 4.0;
  for (double t = 0.5; t < 9.5; t += 0.01) {
    const Eigen::Vector3d exact(-std::sin(t), -0.64 * std::cos(0.8 * t), 0);
    ASSERT_LT((spline.at(t).acceleration - exact).norm(), kWorstAcceleration);
  }
}

TEST_F(PoseFile, EurocTruthIsReadWithWFirst) {
  std::string text = "#timestamp [ns], p_RS_R_x [m], ...\n";
  for (int k = 0; k < 10; ++k)
    text += std::to_string(1600000000000000000 + k * 5000000LL) + ",1,2,3,0.6,0.8,0,0,9,9,9\n";
  const auto poses = read_pose_file(write(text));
  ASSERT_TRUE(poses.has_value()) << poses.error().text();
  EXPECT_NEAR((*poses)[1].t_s, 0.005, 1e-12);
  EXPECT_NEAR((*poses)[1].X_WB.q.w(), 0.6, 1e-12);
  EXPECT_NEAR((*poses)[1].X_WB.q.x(), 0.8, 1e-12);
}

TEST_F(PoseFile, DamageIsNamedWithItsLine) {
  const std::string good = tum(1, 0);
  for (const std::string bad :
       {"1600000009 1 2 3\n", "1600000009 nan 2 3 0 0 0 1\n", "1600000009 1 2 3 0 0 0 2\n",
        "1599999999.0 1 2 3 0 0 0 1\n", "garbage\n", "99999999999999999999 1 2 3 0 0 0 1\n"}) {
    const auto poses = read_pose_file(write(good + bad));
    ASSERT_FALSE(poses.has_value()) << bad;
    EXPECT_NE(poses.error().context.find(":103"), std::string::npos) << poses.error().text();
  }
}

TEST_F(PoseFile, AMissingOrTooShortFileIsAnError) {
  EXPECT_EQ(read_pose_file(path_.string()).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(read_pose_file(write("1.0 0 0 0 0 0 0 1\n")).error().code, ErrorCode::kTruncated);
}

TEST_F(PoseFile, ATrajectoryFromAFileGoesBackAndForthWithoutAJump) {
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
