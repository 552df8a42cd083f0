#include "tools/replay/run_errors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/pose.hpp"

namespace fiducap {
namespace {

constexpr double kRounding = 1e-12;  // metres and radians: a handful of double operations

const Pose kSomewhere{exp_so3({0.3, -0.2, 1.1}), {3, -1, 2}};

Instant at(double seconds) {
  return instant_from_ns(1'600'000'000'000'000'000) + from_seconds(seconds);
}

/// A body that flies straight and turns evenly, sampled at 200 Hz.
Pose motion(double t) {
  return {exp_so3(Eigen::Vector3d(0.1, 0.2, 0.3) * t), {t, -2 * t, 0.5 * t}};
}

std::vector<TruthSample> truth(double seconds) {
  std::vector<TruthSample> samples;
  for (int i = 0; i <= static_cast<int>(seconds * 200 + 0.5); ++i)
    samples.push_back({at(i / 200.0), motion(i / 200.0)});
  return samples;
}

TEST(TruthAt, LiesBetweenTheSamplesAround) {
  const auto samples = truth(1);
  for (const double t : {0.0, 0.5, 0.5013, 0.99999}) {
    const auto pose = truth_at(samples, at(t));
    ASSERT_TRUE(pose) << t;
    EXPECT_LT((pose->p - motion(t).p).norm(), 1e-8) << t;  // stamps are rounded to the nanosecond
    EXPECT_LT(angle_between(pose->q, motion(t).q), 1e-8) << t;
  }
}

TEST(TruthAt, IsNotGuessedOutsideAndInGaps) {
  auto samples = truth(1);
  EXPECT_FALSE(truth_at(samples, at(-0.001)));
  EXPECT_FALSE(truth_at(samples, at(1.001)));
  samples.erase(samples.begin() + 50, samples.begin() + 70);  // 0.1 s
  EXPECT_FALSE(truth_at(samples, at(0.3)));
  EXPECT_TRUE(truth_at(samples, at(0.2)));
  EXPECT_FALSE(truth_at({}, at(0)));
}

TEST(PoseErrors, AnotherWorkspaceIsNoErrorInTheAxesOfTheTag) {
  // The estimate lives in other axes W; both sides see the tag at the same place relative to the
  // body.
  const Pose true_X_WT{exp_so3({0.2, 0.1, -0.4}), {1, 2, 3}};
  std::vector<StampedPose> estimates;
  for (double t = 0.0125; t < 1; t += 0.05)
    estimates.push_back({at(t), kSomewhere * *truth_at(truth(1), at(t))});
  const PoseErrors errors =
      pose_errors(estimates, truth(1), kSomewhere * true_X_WT, true_X_WT, at(0));
  EXPECT_EQ(errors.samples, 20);
  EXPECT_LT(errors.position_max_m, kRounding);
  EXPECT_LT(errors.rotation_max_rad, 1e-7);  // arccos near one
}

TEST(PoseErrors, AreRootMeanSquareAndWorstOfWhatComesAfterTheStart) {
  std::vector<StampedPose> estimates;
  for (const auto& [t, error] :
       {std::pair{0.2, 100.0}, std::pair{0.6, 0.03}, std::pair{0.8, 0.04}}) {
    Pose pose = motion(t);
    pose.p.z() += error;
    pose.q = exp_so3({0, error, 0}) * pose.q;
    estimates.push_back({at(t), pose});
  }
  const PoseErrors errors = pose_errors(estimates, truth(1), Pose{}, Pose{}, at(0.5));
  EXPECT_EQ(errors.samples, 2);
  EXPECT_NEAR(errors.position_rmse_m, std::sqrt((0.03 * 0.03 + 0.04 * 0.04) / 2), 1e-9);
  EXPECT_NEAR(errors.position_max_m, 0.04, 1e-9);
  EXPECT_NEAR(errors.rotation_rmse_rad, std::sqrt((0.03 * 0.03 + 0.04 * 0.04) / 2), 1e-9);
}

std::vector<TagPlace> room() {
  return {{0, 0.2, Pose{}},
          {1, 0.2, {exp_so3({0.1, 0, 0}), {2, 0, 0}}},
          {2, 0.2, {exp_so3({0, 0.4, 0}), {0, 3, 1}}},
          {7, 0.2, {exp_so3({0, 0, 1}), {1, 1, 1}}}};
}

TEST(MapErrors, CountTheTagsThatBothMapsHaveExceptTheReference) {
  std::vector<TagPlace> estimated;
  for (TagPlace tag : room()) {
    tag.X_WT = kSomewhere * tag.X_WT;
    if (tag.tag_id == 1) tag.X_WT = tag.X_WT * Pose{exp_so3({0, 0, 0.02}), {0.01, 0, 0}};
    if (tag.tag_id != 7) estimated.push_back(tag);
  }
  estimated.push_back({99, 0.2, Pose{}});
  const PoseErrors errors = map_errors(estimated, room(), 0);
  EXPECT_EQ(errors.samples, 2);
  EXPECT_NEAR(errors.position_rmse_m, 0.01 / std::sqrt(2.0), kRounding);
  EXPECT_NEAR(errors.position_max_m, 0.01, kRounding);
  EXPECT_NEAR(errors.rotation_max_rad, 0.02, 1e-9);
  EXPECT_EQ(map_errors(estimated, room(), 7).samples, 0)
      << "a reference that one map lacks gives nothing";
}

TEST(MapErrors, FittedErrorsIgnoreWhereTheMapLies) {
  std::vector<TagPlace> estimated = room();
  for (TagPlace& tag : estimated) tag.X_WT = kSomewhere * tag.X_WT;
  const auto errors = fitted_map_errors(estimated, room());
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->samples, 4);
  EXPECT_LT(errors->position_max_m, 1e-9);
  EXPECT_LT(errors->rotation_max_rad, 1e-7);
  estimated.resize(1);
  EXPECT_FALSE(fitted_map_errors(estimated, room())) << "one tag has no shape";
}

TEST(MapErrors, TagsInOneLineLeaveNoRotationOpen) {
  std::vector<TagPlace> line;
  for (int id = 0; id < 4; ++id)
    line.push_back({id, 0.2, {exp_so3({0.3, 0, 0}), {0.5 * id, 1, 2}}});
  std::vector<TagPlace> estimated = line;
  for (TagPlace& tag : estimated) tag.X_WT = kSomewhere * tag.X_WT;
  EXPECT_LT(fitted_map_errors(estimated, line)->rotation_max_rad, 1e-7);
}

TEST(Levelled, KeepsPlaceAndHeadingOnly) {
  const double heading = 0.7;
  const Eigen::Quaterniond turned = exp_so3({0, 0, heading});
  // On a wall: y up, normal horizontal; then pushed over a little about its own x axis, which
  // leaves the heading.
  const Pose wall{turned * exp_so3({std::numbers::pi / 2 + 0.1, 0, 0}), {1, 2, 3}};
  ASSERT_TRUE(heading_along_x(wall));
  const Pose axes = levelled(wall, true);
  EXPECT_LT(angle_between(axes.q, turned), 1e-9);
  EXPECT_EQ(axes.p, wall.p);
}

TEST(Levelled, TakesTheYAxisWhenXIsUpright) {
  const Pose tag{exp_so3({0, -std::numbers::pi / 2, 0}), {0, 0, 1}};  // x points up
  ASSERT_FALSE(heading_along_x(tag));
  EXPECT_LT(angle_between(levelled(tag, false).q, exp_so3({0, 0, std::numbers::pi / 2})), 1e-9);
}

}  // namespace
}  // namespace fiducap
