#include "pipeline/replay/image_placement.hpp"

#include <gtest/gtest.h>

#include <random>

#include "base/pose.hpp"
#include "unit/estimation/example_tags.hpp"

namespace fiducap {
namespace {

constexpr double kNoise_px = 0.2;
// Four corners of 0.2 px on a tag of 0.3 m, seen by 500 px from 2 m: millimetres and a degree; the
// other planar branch is tens of degrees away.
struct Within {
  double m;
  double rad;
};
constexpr Within kBranch{0.1, 0.15};
// By one tag alone, of which the attitude is known to 3 degrees, from 2 m: four sigmas.
constexpr Within kOneTag{0.42, 0.21};

/// Four tags on a wall (z = 0, faces along +z), a camera that passes in front of them.
class ImagePlacementTest : public testing::Test {
 protected:
  static constexpr int kImages = 40;

  ImagePlacementTest() {
    camera_.model = {800, 600, 500, 500, 400, 300, Distortion::kNone, {}};
    for (int id = 0; id < 4; ++id) {
      const Pose X_WT{exp_so3({0.3 * (id % 2), 0.2 - 0.2 * id, 0}),
                      {0.6 * id - 0.9, 0.2 * (id % 2), 0}};
      tags_.push_back({id, 0.3, X_WT, Matrix6d::Zero()});
    }
    for (int i = 0; i < kImages; ++i) {
      const double s = i / 20.0 - 1;
      // Camera axes: z towards the wall, y down.
      const Eigen::Quaterniond towards_wall(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
      poses_.push_back(
          {towards_wall * exp_so3({0.3 * s, -0.4 * s, 0.1}), {s, -0.3 * s, 2 + 0.2 * s}});
    }
  }

  static Instant at(int i) { return instant_from_ns(1'000'000'000 + i * 100'000'000LL); }
  void see(int i, const std::vector<int>& ids) {
    TagObservations seen;
    seen.exposed_at = at(i);
    for (const int id : ids) {
      const KnownTag& tag = tags_[static_cast<std::size_t>(id)];
      const Pose X_VT = poses_[static_cast<std::size_t>(i)].inverse() * tag.X_WT;
      seen.tags.push_back(
          noisy_observation(id, tag.edge_m, X_VT, camera_.model, kNoise_px, random_));
    }
    add_to(log_, seen);
  }
  /// Two halves of images that share no tag.
  void see_two_pairs() {
    for (int i = 0; i < kImages; ++i) see(i, i < 20 ? std::vector{0, 1} : std::vector{2, 3});
  }
  /// One tag after the other, with the true motion in axes of its own.
  void see_single_tags_with_odometry() {
    has_odometry_ = true;
    for (int i = 0; i < kImages; ++i) {
      odometry_.poses.push_back({at(i), kOfOdometry * poses_[static_cast<std::size_t>(i)]});
      see(i, {i / 10});
    }
  }
  /// @param held  its pose is given
  ImagePlacement placement(std::optional<std::size_t> held = {}) const {
    ImagePlacement out({{&log_, {camera_}, has_odometry_ ? &odometry_ : nullptr, kNoise_px}},
                       EstimatorConfig{}.branch_evidence);
    if (held) out.put(tags_[*held], true);
    return out;
  }
  static void expect_at(const Pose& found, const Pose& truth, const Within& within = kBranch) {
    EXPECT_LT((found.p - truth.p).norm(), within.m);
    EXPECT_LT(angle_between(found.q, truth.q), within.rad);
  }
  void expect_all_placed(const ImagePlacement& placement, const Within& within = kBranch) const {
    ASSERT_EQ(placement.tags().size(), tags_.size());
    for (const auto& [id, tag] : placement.tags())
      expect_at(tag.tag.X_WT, tags_[static_cast<std::size_t>(id)].X_WT, within);
    for (std::size_t i = 0; i < kImages; ++i)
      expect_at(placement.placed(0)[i].X_WB, poses_[i], within);
  }

  static inline const Pose kOfOdometry{exp_so3({0, 0, 0.7}), {3, -2, 1}};
  Odometry odometry_;
  bool has_odometry_{false};
  CameraMount camera_;
  ImageLog log_;
  std::mt19937 random_{11};
  std::vector<KnownTag> tags_;  ///< The truth, as the poses.
  std::vector<Pose> poses_;
};

TEST_F(ImagePlacementTest, PlacesAllTagsAndImagesFromOneKnownTag) {
  for (int i = 0; i < kImages; ++i) {
    see(i, i < 14 ? std::vector{0, 1} : i < 27 ? std::vector{1, 2} : std::vector{2, 3});
  }
  ImagePlacement placement = this->placement(0);
  EXPECT_TRUE(placement.settle());
  expect_all_placed(placement);
  for (const auto& image : placement.placed(0)) EXPECT_EQ(image.region, 0);
  EXPECT_EQ(placement.tags().at(0).tag.X_WT.p, tags_[0].X_WT.p) << "is given";
  EXPECT_FALSE(placement.settle()) << "no changes";
}

TEST_F(ImagePlacementTest, ImagesWithoutCommonTagsHaveAxesOfTheirOwn) {
  see_two_pairs();
  ImagePlacement placement = this->placement(0);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 2);
  EXPECT_EQ(placement.tags().at(1).region, 0);
  EXPECT_EQ(placement.tags().at(2).region, 1);
  EXPECT_EQ(placement.tags().at(3).region, 1);
  EXPECT_EQ(placement.placed(0)[5].region, 0);
  const Pose over = tags_[2].X_WT * placement.tags().at(2).tag.X_WT.inverse();
  expect_at(over * placement.tags().at(3).tag.X_WT, tags_[3].X_WT);
  for (std::size_t i = 20; i < kImages; ++i) {
    EXPECT_EQ(placement.placed(0)[i].region, 1);
    expect_at(over * placement.placed(0)[i].X_WB, poses_[i]);
  }
}

TEST_F(ImagePlacementTest, OdometryConnectsTagsThatAreNeverSeenTogether) {
  see_single_tags_with_odometry();
  ImagePlacement placement = this->placement(1);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 1);
  expect_all_placed(placement, kOneTag);
}

TEST_F(ImagePlacementTest, ReferenceTagPlacesOdometryWithoutAKnownTag) {
  see_single_tags_with_odometry();
  ImagePlacement placement = this->placement();
  EXPECT_TRUE(placement.settle());
  ASSERT_EQ(placement.tags().size(), 4U);
  expect_at(placement.tags().at(2).tag.X_WT, kOfOdometry * tags_[2].X_WT, kOneTag);
  placement.define_workspace({.reference_tag = 2, .X_WT = tags_[2].X_WT});
  expect_all_placed(placement, kOneTag);
  const Pose X_WT = placement.tags().at(0).tag.X_WT;
  placement.define_workspace({.reference_tag = 2, .X_WT = {}});
  EXPECT_EQ(placement.tags().at(0).tag.X_WT.p, X_WT.p) << "it is defined once";
}

TEST_F(ImagePlacementTest, ImagesOfTwoTagsConnectTheirAxes) {
  for (int i = 0; i < kImages; ++i)
    see(i, i < 18 ? std::vector{0, 1} : i < 22 ? std::vector{1, 3} : std::vector{3});
  ImagePlacement placement = this->placement(0);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.tags().at(3).region, 0) << "four images show it with a tag of the workspace";
  expect_at(placement.tags().at(3).tag.X_WT, tags_[3].X_WT, kOneTag);
  for (std::size_t i = 22; i < kImages; ++i) EXPECT_EQ(placement.placed(0)[i].region, 0);
}

TEST_F(ImagePlacementTest, ARarelySeenTagHasNoAxes) {
  for (int i = 0; i < 24; ++i) see(i, i < 20 ? std::vector{0, 1} : std::vector{3});
  ImagePlacement placement = this->placement(0);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 1);
  EXPECT_FALSE(placement.tags().contains(3));
  EXPECT_EQ(placement.placed(0)[22].region, ImagePlacement::kNowhere);
}

TEST_F(ImagePlacementTest, ARoughlySurveyedTagIsAStart) {
  see_two_pairs();
  ImagePlacement placement = this->placement(0);
  const Pose shift{Eigen::Quaterniond::Identity(), {0.3, 0.2, -0.1}};
  KnownTag rough = tags_[2];
  rough.X_WT = shift * rough.X_WT;
  placement.survey(rough);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 1);
  EXPECT_EQ(placement.placed(0)[25].region, 0);
  expect_at(placement.tags().at(3).tag.X_WT, shift * tags_[3].X_WT);
}

TEST_F(ImagePlacementTest, CorrectsATagInTheWrongBranch) {
  for (int i = 0; i < kImages; ++i) see(i, {0, 1, 2, 3});
  ImagePlacement placement = this->placement();
  for (KnownTag tag : tags_) {
    if (tag.tag_id == 3) tag.X_WT.q = tag.X_WT.q * exp_so3({0.0, 0.9, 0.0});
    placement.put(tag, false);
  }
  EXPECT_TRUE(placement.settle());
  expect_at(placement.tags().at(3).tag.X_WT, tags_[3].X_WT);
}

TEST_F(ImagePlacementTest, LearnsTheNoiseOfTheCorners) {
  for (int i = 0; i < kImages; ++i) see(i, {0, 1, 2, 3});
  ImagePlacement placement = this->placement();
  for (const KnownTag& tag : tags_) placement.put(tag, true);
  (void)placement.settle();
  // Each image's pose takes 6 of its 32 numbers.
  EXPECT_NEAR(placement.learn_noise(0), kNoise_px * std::sqrt(26.0 / 32), 0.1 * kNoise_px);
}

TEST_F(ImagePlacementTest, ImagesWithoutAKnownTagAreNotPlaced) {
  see(0, {0, 1});
  see(1, {});
  ImagePlacement placement = this->placement();
  EXPECT_FALSE(placement.settle());
  ASSERT_EQ(placement.placed(0).size(), 1U) << "images without tags are not logged";
  EXPECT_EQ(placement.placed(0)[0].region, ImagePlacement::kNowhere);
}

}  // namespace
}  // namespace fiducap
