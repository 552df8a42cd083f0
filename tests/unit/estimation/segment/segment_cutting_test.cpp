#include "estimation/segment/segment_cutting.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"

namespace fiducap {
namespace {

using std::chrono::milliseconds;

/// A body that walks along x, 10 images a second, each with tag 1 and a tag without a pose.
class SegmentCuttingTest : public testing::Test {
 protected:
  SegmentCuttingTest() {
    path_.body_id = 3;
    path_.chain = 5;
    path_.sensors = std::make_shared<const SegmentSensors>();
    path_.motion = motion_without_imu({});
    path_.cameras.resize(1);
    path_.tags[1] = {1, 0.2, {}, Matrix6d::Zero()};
  }
  void walk(int from_ms, int images) {
    for (int i = 0; i < images; ++i) {
      const Instant at = Instant{} + milliseconds(from_ms + 100 * i);
      const double s = to_seconds(at - Instant{});
      SegmentImage image;
      image.tags.resize(2);
      image.tags[0].seen.tag_id = 1;
      image.tags[1].seen.tag_id = 2;
      path_.instants.push_back({at, {exp_so3({0, 0, 0.2 * s}), {s, 0, 0}}, {image}});
    }
  }
  PlacedPath path_;
};

TEST_F(SegmentCuttingTest, CutsAfterASecondWithoutGapsAndEveryImageIsInOneSegment) {
  walk(0, 26);
  const auto segments = cut_segments(path_);
  ASSERT_EQ(segments.size(), 3U);
  std::size_t images = 0;
  for (const MotionSegment& segment : segments) {
    EXPECT_EQ(segment.body_id, 3);
    EXPECT_EQ(segment.chain, 5);
    ASSERT_EQ(segment.tags.size(), 1U) << "the other one has no pose";
    for (const MotionSegment::Instance& instance : segment.instances) {
      images += instance.images.size();
      double steps_s = 0;
      for (const SegmentStep& step : instance.steps) steps_s += step.dt_s;
      EXPECT_NEAR(steps_s, &instance == &segment.instances.front() ? 0 : 0.1, 1e-9);
    }
  }
  EXPECT_EQ(images, 26U);
  EXPECT_EQ(segments[0].end().at, segments[1].begin().at);
  EXPECT_EQ(segments[0].end().at - segments[0].begin().at, std::chrono::seconds(1));
}

TEST_F(SegmentCuttingTest, VelocitiesAreDifferencesOfNeighbours) {
  walk(0, 12);
  const BodyMoment body = cut_segments(path_).front().instances[4].body;
  EXPECT_LT((body.v_WB - Eigen::Vector3d(1, 0, 0)).norm(), 1e-9);
  EXPECT_LT((body.bias_w - Eigen::Vector3d(0, 0, -0.2)).norm(), 1e-9);
}

/// Odometry of a body on a circle, in its own axes.
Odometry on_a_circle(double seconds) {
  Odometry out;
  for (double s = 0; s <= seconds; s += 0.5)
    out.poses.push_back({Instant{} + from_seconds(s),
                         {exp_so3({0, 0, 0.3 * s}), {std::sin(0.3 * s), -std::cos(0.3 * s), 2}}});
  return out;
}

TEST_F(SegmentCuttingTest, AChainEndsAfterALongTimeWithoutTagsAndOdometry) {
  walk(0, 5);
  walk(20'000, 5);
  const Odometry odometry = on_a_circle(10);
  for (const Odometry* used : {static_cast<const Odometry*>(nullptr), &odometry}) {
    path_.odometry = used;
    const auto segments = cut_segments(path_);
    ASSERT_EQ(segments.size(), 2U);
    EXPECT_NE(segments[0].chain, segments[1].chain);
  }
}

TEST_F(SegmentCuttingTest, OdometryBridgesALongTimeWithoutTags) {
  walk(0, 5);
  walk(60'250, 5);
  const Odometry odometry = on_a_circle(70);
  path_.odometry = &odometry;
  const auto segments = cut_segments(path_);
  ASSERT_EQ(segments.size(), 2U);
  EXPECT_EQ(segments[0].chain, segments[1].chain);
  Pose X_WB = path_.instants[0].X_WB;
  double moved_s = 0;
  const auto follow = [&](const SegmentStep& step) {
    EXPECT_LE(step.dt_s, 0.5 + 1e-9) << "from pose to pose";
    moved_s += step.dt_s;
    X_WB = X_WB * Pose{exp_so3(step.dt_s * step.input.w_B), step.dt_s * *step.input.v_B};
  };
  for (const MotionSegment& segment : segments)
    for (const MotionSegment::Instance& instance : segment.instances)
      std::for_each(instance.steps.begin(), instance.steps.end(), follow);
  EXPECT_NEAR(moved_s, 60.65, 1e-9);
  const Pose expected =
      path_.instants[0].X_WB * *odometry.motion(path_.instants[0].at, path_.instants.back().at);
  EXPECT_LT((X_WB.p - expected.p).norm(), 1e-9);
  EXPECT_LT(angle_between(X_WB.q, expected.q), 1e-9);
}

TEST_F(SegmentCuttingTest, AnInstantOnItsOwnIsASegmentWithAnEmptyEnd) {
  walk(0, 1);
  const auto segments = cut_segments(path_);
  ASSERT_EQ(segments.size(), 1U);
  ASSERT_EQ(segments[0].instances.size(), 2U);
  EXPECT_EQ(segments[0].instances[0].images.size(), 1U);
  EXPECT_TRUE(segments[0].instances[1].images.empty());
}

TEST_F(SegmentCuttingTest, NoPosesGiveNoSegments) { EXPECT_TRUE(cut_segments(path_).empty()); }

}  // namespace
}  // namespace fiducap
