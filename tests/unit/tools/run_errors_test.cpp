#include "tools/replay/run_errors.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

using ::testing::_;
using ::testing::DoubleNear;
using ::testing::FieldsAre;

constexpr double kRounding = 1e-12;  // metres and radians: a handful of double operations
const Pose kSomewhere{exp_so3({0.3, -0.2, 1.1}), {3, -1, 2}};

Instant at(double seconds) {
  return instant_from_ns(1'600'000'000'000'000'000) + from_seconds(seconds);
}

/// A body in uniform translation and rotation, sampled at 200 Hz.
Pose motion(double t) {
  return {exp_so3(Eigen::Vector3d(0.1, 0.2, 0.3) * t), {t, -2 * t, 0.5 * t}};
}
std::vector<TruthSample> truth() {
  std::vector<TruthSample> samples;
  for (int i = 0; i <= 200; ++i) samples.push_back({at(i / 200.0), motion(i / 200.0)});
  return samples;
}

TEST(TruthAt, InterpolatesBetweenSamples) {
  for (const double t : {0.0, 0.5, 0.5013, 0.99999}) {
    const auto pose = truth_at(truth(), at(t));
    ASSERT_TRUE(pose) << t;
    EXPECT_LT((pose->p - motion(t).p).norm(), 1e-8) << t;  // stamps are rounded to the nanosecond
    EXPECT_LT(angle_between(pose->q, motion(t).q), 1e-8) << t;
  }
}

TEST(TruthAt, IsUnknownOutsideAndInGaps) {
  auto samples = truth();
  EXPECT_FALSE(truth_at(samples, at(-0.001)));
  EXPECT_FALSE(truth_at(samples, at(1.001)));
  samples.erase(samples.begin() + 50, samples.begin() + 70);  // 0.1 s
  EXPECT_FALSE(truth_at(samples, at(0.3)));
  EXPECT_TRUE(truth_at(samples, at(0.2)));
  EXPECT_FALSE(truth_at({}, at(0)));
}

TEST(PoseErrors, InTagAxesIgnoreTheWorkspace) {
  const Pose true_X_WT{exp_so3({0.2, 0.1, -0.4}), {1, 2, 3}};
  std::vector<StampedPose> estimates;
  for (double t = 0.0125; t < 1; t += 0.05)
    estimates.push_back({at(t), kSomewhere * *truth_at(truth(), at(t))});
  const PoseErrors errors =
      pose_errors(estimates, truth(), kSomewhere * true_X_WT, true_X_WT, at(0));
  EXPECT_EQ(errors.samples, 20);
  EXPECT_LT(errors.position_max_m, kRounding);
  EXPECT_LT(errors.rotation_max_rad, 1e-7);  // arccos near one
}

TEST(FittedAxes, AreThoseOfTheBestRigidFit) {
  std::vector<TruthSample> curve;
  std::vector<StampedPose> estimates;
  for (int i = 0; i <= 200; ++i) {
    const double t = i / 200.0;
    const Pose pose{motion(t).q, {std::cos(5 * t), std::sin(5 * t), t * t}};
    curve.push_back({at(t), pose});
    estimates.push_back({at(t), kSomewhere * pose});
  }
  const Pose fitted = fitted_axes(estimates, curve, at(0)).value();
  EXPECT_LT((fitted.p - kSomewhere.p).norm(), 1e-9);
  EXPECT_LT(angle_between(fitted.q, kSomewhere.q), 1e-9);
  EXPECT_LT(pose_errors(estimates, curve, fitted, Pose{}, at(0)).position_max_m, 1e-9);
  EXPECT_FALSE(fitted_axes(estimates, curve, at(0.995)));
}

TEST(PoseErrors, AreRmsAndMaximumAfterTheStart) {
  std::vector<StampedPose> estimates;
  for (const auto& [t, error] :
       {std::pair{0.2, 100.0}, std::pair{0.6, 0.03}, std::pair{0.8, 0.04}}) {
    Pose pose = motion(t);
    pose.p.z() += error;
    pose.q = exp_so3({0, error, 0}) * pose.q;
    estimates.push_back({at(t), pose});
  }
  const PoseErrors errors = pose_errors(estimates, truth(), Pose{}, Pose{}, at(0.5));
  const auto rms = DoubleNear(std::sqrt((0.03 * 0.03 + 0.04 * 0.04) / 2), 1e-9);
  EXPECT_THAT(errors, FieldsAre(2, rms, DoubleNear(0.04, 1e-9), rms, _));
}

std::vector<TagPlace> room() {
  return {{0, 0.2, Pose{}},
          {1, 0.2, {exp_so3({0.1, 0, 0}), {2, 0, 0}}},
          {2, 0.2, {exp_so3({0, 0.4, 0}), {0, 3, 1}}},
          {7, 0.2, {exp_so3({0, 0, 1}), {1, 1, 1}}}};
}
std::vector<TagPlace> displaced(std::vector<TagPlace> tags) {
  for (TagPlace& tag : tags) tag.X_WT = kSomewhere * tag.X_WT;
  return tags;
}

TEST(MapErrors, CountCommonTagsWithoutTheReference) {
  std::vector<TagPlace> estimated = displaced(room());
  estimated[1].X_WT = estimated[1].X_WT * Pose{exp_so3({0, 0, 0.02}), {0.01, 0, 0}};
  estimated[3] = {99, 0.2, Pose{}};
  const PoseErrors errors = map_errors(estimated, room(), 0);
  EXPECT_THAT(errors, FieldsAre(2, DoubleNear(0.01 / std::sqrt(2.0), kRounding),
                                DoubleNear(0.01, kRounding), _, DoubleNear(0.02, 1e-9)));
  EXPECT_EQ(map_errors(estimated, room(), 7).samples, 0) << "the reference is missing in one map";
}

TEST(MapErrors, AfterAFitIgnoreWhereTheMapLies) {
  std::vector<TagPlace> estimated = displaced(room());
  const auto errors = fitted_map_errors(estimated, room());
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->samples, 4);
  EXPECT_LT(errors->position_max_m, 1e-9);
  EXPECT_LT(errors->rotation_max_rad, 1e-7);
  estimated.resize(1);
  EXPECT_FALSE(fitted_map_errors(estimated, room())) << "one tag has no shape";
}

TEST(MapErrors, FitDeterminesTheRotationOfTagsInALine) {
  std::vector<TagPlace> line;
  for (int id = 0; id < 4; ++id)
    line.push_back({id, 0.2, {exp_so3({0.3, 0, 0}), {0.5 * id, 1, 2}}});
  EXPECT_LT(fitted_map_errors(displaced(line), line)->rotation_max_rad, 1e-7);
}

TEST(Levelled, KeepsPlaceAndHeadingOnly) {
  const Eigen::Quaterniond heading = exp_so3({0, 0, 0.7});
  // On a wall: y up, normal horizontal; then tilted about its own x axis, which leaves the heading.
  const Pose wall{heading * exp_so3({std::numbers::pi / 2 + 0.1, 0, 0}), {1, 2, 3}};
  ASSERT_TRUE(heading_along_x(wall));
  EXPECT_LT(angle_between(levelled(wall, true).q, heading), 1e-9);
  EXPECT_EQ(levelled(wall, true).p, wall.p);
}

TEST(Levelled, UsesTheYAxisWhenXIsVertical) {
  const Pose tag{exp_so3({0, -std::numbers::pi / 2, 0}), {0, 0, 1}};  // x points up
  ASSERT_FALSE(heading_along_x(tag));
  EXPECT_LT(angle_between(levelled(tag, false).q, exp_so3({0, 0, std::numbers::pi / 2})), 1e-9);
}

constexpr double kRounding_px = 1e-9;

class ReprojectionTest : public ::testing::Test {
 protected:
  ReprojectionTest() {
    camera_.model = {
        752, 480, 460, 450, 376, 240, Distortion::kRadialTangential, {-0.2, 0.05, 1e-3, -1e-3, 0}};
    camera_.X_BV = X_BV_;
  }

  /// What the camera sees of tag 4 from pose 0, every corner moved by `off`.
  [[nodiscard]] TagSighting sighting(const Eigen::Vector2d& off, int id = 4) const {
    TagSighting seen;
    seen.tag_id = id;
    const Pose X_VW = (poses_[0].X_WB * X_BV_).inverse();
    for (int i = 0; i < 4; ++i)
      seen.corners_px[static_cast<std::size_t>(i)] =
          camera_.model.project(X_VW * (map_[0].X_WT * tag_corner(i, 0.2))).value() + off;
    return seen;
  }
  [[nodiscard]] ReprojectionSummary summary_of(const std::vector<CornerFrame>& images) const {
    ReprojectionMeter meter({camera_}, poses_, map_);
    for (const CornerFrame& image : images) meter.add(image);
    return meter.summary();
  }
  [[nodiscard]] static Instant at(int frame) {
    return instant_from_ns(1'000'000'000 + 50'000'000 * frame);
  }

  const Pose X_BV_{exp_so3({0.1, -0.2, 0.3}), {0.05, -0.02, 0.01}};
  CameraMount camera_;
  std::vector<StampedPose> poses_{{at(0), {exp_so3({0, 0, 0.4}), {1, 2, 3}}}};
  // Two metres in front of that camera, facing it.
  std::vector<TagPlace> map_{
      {4, 0.2, poses_[0].X_WB* X_BV_* Pose{exp_so3({3.1, 0.2, 0}), {0.1, -0.1, 2}}}};
};

TEST_F(ReprojectionTest, IsTheRmsDistanceOfTheFourCorners) {
  ReprojectionSummary summary = summary_of({{0, at(0), {sighting({0.3, 0.4})}}});
  EXPECT_NEAR(summary.median_px, 0.5, kRounding_px);
  EXPECT_NEAR(summary.p95_px, 0.5, kRounding_px);
  TagSighting one_off = sighting({0, 0});
  one_off.corners_px[2].x() += 2;
  EXPECT_NEAR(summary_of({{0, at(0), {one_off}}}).median_px, 1.0, kRounding_px);
}

TEST_F(ReprojectionTest, UsesPartsForImagesWithoutAPose) {
  const TagSighting in_part = sighting({0, 2}, 9);
  const Pose elsewhere{exp_so3({0, 0, 1}), {10, 0, 0}};
  const std::vector<StampedPose> poses{{at(40), elsewhere * poses_[0].X_WB}};
  const std::vector<TagPlace> map{{9, 0.2, elsewhere * map_[0].X_WT}};
  ReprojectionMeter meter({camera_}, poses_, map_);
  meter.add_part(poses, map);
  meter.add({0, at(0), {sighting({0.3, 0.4})}});
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

TEST_F(ReprojectionTest, CountsWhyDetectionsAreNotScored) {
  const Pose X_VT{Eigen::Quaterniond::Identity(), {0, 0, -1}};  // behind the camera
  map_.push_back({5, 0.2, poses_[0].X_WB * X_BV_ * X_VT});
  const ReprojectionSummary summary =
      summary_of({{0, at(0), {sighting({0, 0}), sighting({0, 0}, 5), sighting({0, 0}, 6)}},
                  {0, at(1), {sighting({0, 0})}},
                  {0, at(2), {}}});
  EXPECT_EQ(summary.detections, 4);
  EXPECT_EQ(summary.scored, 1);
  EXPECT_EQ(summary.outside_camera, 1);
  EXPECT_EQ(summary.without_tag, 1);
  EXPECT_EQ(summary.without_pose, 1);
  EXPECT_EQ(summary.frames, 3);
  EXPECT_EQ(summary.frames_with_tags, 2);
  EXPECT_DOUBLE_EQ(summary.coverage(), 0.5);
}

// The camera's clock was estimated 20 ms late: poses have the corrected times.
TEST_F(ReprojectionTest, UsesThePoseWithinHalfAFramePeriod) {
  constexpr Duration kShift = std::chrono::milliseconds(20);
  const TagSighting seen = sighting({0.3, 0.4});
  const Pose X_WB = poses_[0].X_WB;
  const Pose elsewhere = X_WB * Pose{Eigen::Quaterniond::Identity(), {0.1, 0, 0}};
  poses_ = {{at(0) + kShift, elsewhere}, {at(1) + kShift, X_WB}, {at(2) + kShift, elsewhere}};
  for (const Duration stamp_error : {kShift, -kShift, Duration{0}}) {
    const auto summary = summary_of({{0, at(1) + kShift - stamp_error, {seen}}});
    EXPECT_DOUBLE_EQ(summary.coverage(), 1.0);
    EXPECT_NEAR(summary.median_px, 0.5, kRounding_px);
  }
}

TEST_F(ReprojectionTest, ImagesBeyondHalfAPeriodHaveNoPose) {
  const TagSighting seen = sighting({0, 0});
  for (int frame = 1; frame < 9; ++frame) poses_.push_back({at(frame), poses_[0].X_WB});
  poses_.erase(poses_.begin() + 4);
  const auto summary = summary_of({{0, at(4), {seen}},
                                   {0, at(0) - std::chrono::milliseconds(26), {seen}},
                                   {0, at(8) + std::chrono::milliseconds(26), {seen}}});
  EXPECT_EQ(summary.without_pose, 3);
  EXPECT_DOUBLE_EQ(summary.coverage(), 0.0);
}

TEST_F(ReprojectionTest, DetectionsWithoutAScoreCountAsWorst) {
  std::vector<CornerFrame> images;
  for (int i = 1; i <= 99; ++i) images.push_back({0, at(0), {sighting({0.01 * i, 0})}});
  const CornerFrame unknown_tag{0, at(0), {sighting({0, 0}, 6)}};
  images.push_back(unknown_tag);
  const auto summary = summary_of(images);
  ASSERT_EQ(summary.scored, 99);
  EXPECT_NEAR(summary.p95_px, 0.941, 1e-3);
  EXPECT_NEAR(summary.p95_of_all_px.value(), 0.9505, 1e-3);
  images.insert(images.end(), 6, unknown_tag);
  EXPECT_FALSE(summary_of(images).p95_of_all_px) << "7 of 106 are not scored";
}

}  // namespace
}  // namespace fiducap
