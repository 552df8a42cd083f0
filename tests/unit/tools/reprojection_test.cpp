#include "tools/replay/run_errors.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr double kRounding_px = 1e-9;

class ReprojectionTest : public ::testing::Test {
 protected:
  ReprojectionTest() {
    camera_.model = {
        752, 480, 460, 450, 376, 240, Distortion::kRadialTangential, {-0.2, 0.05, 1e-3, -1e-3, 0}};
    camera_.X_BV = {exp_so3({0.1, -0.2, 0.3}), {0.05, -0.02, 0.01}};
  }

  /// What the camera sees of tag 4 from pose 0, every corner moved by `off`.
  [[nodiscard]] TagSighting sighting(const Eigen::Vector2d& off, int id = 4) const {
    TagSighting seen;
    seen.tag_id = id;
    const Pose X_VW = (poses_[0].X_WB * camera_.X_BV).inverse();
    for (int i = 0; i < 4; ++i)
      seen.corners_px[static_cast<std::size_t>(i)] =
          camera_.model.project(X_VW * (map_[0].X_WT * tag_corner(i, 0.2))).value() + off;
    return seen;
  }
  [[nodiscard]] static Instant at(int frame) {
    return instant_from_ns(1'000'000'000 + 50'000'000 * frame);
  }

  CameraMount camera_;
  std::vector<StampedPose> poses_{{at(0), {exp_so3({0, 0, 0.4}), {1, 2, 3}}}};
  // Two metres in front of that camera, facing it.
  std::vector<TagPlace> map_{{4, 0.2,
                              poses_[0].X_WB* Pose{exp_so3({0.1, -0.2, 0.3}), {0.05, -0.02, 0.01}} *
                                  Pose{exp_so3({3.1, 0.2, 0}), {0.1, -0.1, 2}}}};
};

TEST_F(ReprojectionTest, IsTheRootMeanSquareDistanceOfTheFourCorners) {
  ReprojectionMeter meter({camera_}, poses_, map_);
  meter.add({0, at(0), {sighting({0.3, 0.4})}});
  EXPECT_NEAR(meter.summary().median_px, 0.5, kRounding_px);
  EXPECT_NEAR(meter.summary().p95_px, 0.5, kRounding_px);
}

TEST_F(ReprojectionTest, WhatHasAxesOfItsOwnCountsWhereThereIsNoPose) {
  const TagSighting in_workspace = sighting({0.3, 0.4});
  const TagSighting in_part = sighting({0, 2}, 9);
  const Pose elsewhere{exp_so3({0, 0, 1}), {10, 0, 0}};
  const std::vector<StampedPose> poses{{at(40), elsewhere * poses_[0].X_WB}};
  const std::vector<TagPlace> map{{9, 0.2, elsewhere * map_[0].X_WT}};
  ReprojectionMeter meter({camera_}, poses_, map_);
  meter.add_part(poses, map);
  meter.add({0, at(0), {in_workspace}});
  meter.add({0, at(40), {in_part}});
  meter.add({0, at(80), {in_part}});
  const ReprojectionSummary summary = meter.summary();
  EXPECT_EQ(summary.scored, 2);
  EXPECT_NEAR(summary.p95_px, 0.95 * 2 + 0.05 * 0.5, kRounding_px);
  EXPECT_EQ(summary.frames_with_tags_and_pose, 1);
  EXPECT_EQ(summary.frames_with_tags_in_parts, 1);
  EXPECT_EQ(summary.without_pose, 1);
  EXPECT_NEAR(summary.coverage(), 1. / 3, 1e-12);
  EXPECT_NEAR(summary.coverage_with_parts(), 2. / 3, 1e-12);
}

TEST_F(ReprojectionTest, OneBadCornerCountsAQuarterOfItsSquare) {
  TagSighting seen = sighting({0, 0});
  seen.corners_px[2].x() += 2;
  ReprojectionMeter meter({camera_}, poses_, map_);
  meter.add({0, at(0), {seen}});
  EXPECT_NEAR(meter.summary().median_px, 1.0, kRounding_px);
}

TEST_F(ReprojectionTest, SaysWhyADetectionIsNotScored) {
  map_.push_back({5, 0.2,
                  poses_[0].X_WB * camera_.X_BV *
                      Pose{Eigen::Quaterniond::Identity(), {0, 0, -1}}});  // behind the camera
  ReprojectionMeter meter({camera_}, poses_, map_);
  meter.add({0, at(0), {sighting({0, 0}), sighting({0, 0}, 5), sighting({0, 0}, 6)}});
  meter.add({0, at(1), {sighting({0, 0})}});
  meter.add({0, at(2), {}});
  const ReprojectionSummary summary = meter.summary();
  EXPECT_EQ(summary.detections, 4);
  EXPECT_EQ(summary.scored, 1);
  EXPECT_EQ(summary.outside_camera, 1);
  EXPECT_EQ(summary.without_tag, 1);
  EXPECT_EQ(summary.without_pose, 1);
  EXPECT_EQ(summary.frames, 3);
  EXPECT_EQ(summary.frames_with_tags, 2);
  EXPECT_DOUBLE_EQ(summary.coverage(), 0.5);
}

// The clock of the camera was found to be 20 ms late: poses stand at the corrected times.
TEST_F(ReprojectionTest, GivesAnImageThePoseNearestToItsStampWithinHalfAFramePeriod) {
  constexpr Duration kShift = std::chrono::milliseconds(20);
  const TagSighting seen = sighting({0.3, 0.4});
  const Pose X_WB = poses_[0].X_WB;
  const Pose elsewhere = X_WB * Pose{Eigen::Quaterniond::Identity(), {0.1, 0, 0}};
  poses_ = {{at(0) + kShift, elsewhere}, {at(1) + kShift, X_WB}, {at(2) + kShift, elsewhere}};
  for (const Duration stamp_error : {kShift, -kShift, Duration{0}}) {
    ReprojectionMeter meter({camera_}, poses_, map_);
    meter.add({0, at(1) + kShift - stamp_error, {seen}});
    EXPECT_DOUBLE_EQ(meter.summary().coverage(), 1.0);
    EXPECT_NEAR(meter.summary().median_px, 0.5, kRounding_px);
  }
}

TEST_F(ReprojectionTest, WhatIsNotScoredIsWorseThanAnyInTheWhole) {
  ReprojectionMeter meter({camera_}, poses_, map_);
  for (int i = 1; i <= 99; ++i) meter.add({0, at(0), {sighting({0.01 * i, 0})}});
  meter.add({0, at(0), {sighting({0, 0}, 6)}});  // nobody knows where that is
  ASSERT_EQ(meter.summary().scored, 99);
  EXPECT_NEAR(meter.summary().p95_px, 0.941, 1e-3);
  EXPECT_NEAR(meter.summary().p95_of_all_px.value(), 0.9505, 1e-3);
  for (int i = 0; i < 6; ++i) meter.add({0, at(0), {sighting({0, 0}, 6)}});
  EXPECT_FALSE(meter.summary().p95_of_all_px) << "7 of 106 are not scored";
}

TEST_F(ReprojectionTest, AnImageFartherThanHalfAPeriodFromEveryPoseHasNone) {
  const TagSighting seen = sighting({0, 0});
  for (int frame = 1; frame < 9; ++frame) poses_.push_back({at(frame), poses_[0].X_WB});
  poses_.erase(poses_.begin() + 4);
  ReprojectionMeter meter({camera_}, poses_, map_);
  meter.add({0, at(4), {seen}});
  meter.add({0, at(0) - std::chrono::milliseconds(26), {seen}});
  meter.add({0, at(8) + std::chrono::milliseconds(26), {seen}});
  EXPECT_EQ(meter.summary().without_pose, 3);
  EXPECT_DOUBLE_EQ(meter.summary().coverage(), 0.0);
}

TEST(Quantile, InterpolatesBetweenNeighbours) {
  EXPECT_DOUBLE_EQ(quantile({3, 1, 2}, 0.5), 2);
  EXPECT_DOUBLE_EQ(quantile({0, 10}, 0.95), 9.5);
  EXPECT_DOUBLE_EQ(quantile({7}, 0.95), 7);
  EXPECT_DOUBLE_EQ(quantile({}, 0.5), 0);
}

}  // namespace
}  // namespace fiducap
