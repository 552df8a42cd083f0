#include "pipeline/replay/image_placement.hpp"

#include <gtest/gtest.h>

#include <random>

#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr double kNoise_px = 0.2;
// Four corners of 0.2 px on a tag of 0.3 m, seen by 500 px from 2 m: millimetres and a degree; the
// other planar branch is tens of degrees away.
constexpr double kBranch_m = 0.1;
constexpr double kBranch_rad = 0.15;
// By one tag alone, of which the attitude is known to 3 degrees, from 2 m.
constexpr double kOneTag_m = 0.25;

/// Four tags on a wall (z = 0, faces along +z), a camera that passes in front of them.
class ImagePlacementTest : public testing::Test {
 protected:
  ImagePlacementTest() {
    camera_.model = {800, 600, 500, 500, 400, 300, Distortion::kNone, {}};
    for (int id = 0; id < 4; ++id) {
      const Pose X_WT{exp_so3({0.3 * (id % 2), 0.2 - 0.2 * id, 0}),
                      {0.6 * id - 0.9, 0.2 * (id % 2), 0}};
      true_tags_.push_back({id, 0.3, X_WT, Matrix6d::Zero()});
    }
    for (int i = 0; i < 40; ++i) {
      const double s = i / 20.0 - 1;
      // Camera axes: z towards the wall, y down.
      const Eigen::Quaterniond towards_wall(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
      true_poses_.push_back(
          {towards_wall * exp_so3({0.3 * s, -0.4 * s, 0.1}), {s, -0.3 * s, 2 + 0.2 * s}});
    }
  }

  void see(int i, const std::vector<int>& ids, const std::optional<Pose>& X_WB = {}) {
    TagObservations seen;
    seen.exposed_at = instant_from_ns(1'000'000'000 + i * 100'000'000LL);
    for (const int id : ids) {
      const KnownTag& tag = true_tags_[static_cast<std::size_t>(id)];
      const Pose X_VT = true_poses_[static_cast<std::size_t>(i)].inverse() * tag.X_WT;
      TagObservation out;
      out.tag_id = id;
      out.edge_m = tag.edge_m;
      for (int k = 0; k < 4; ++k) {
        const auto corner = static_cast<std::size_t>(k);
        out.corners_px[corner] = camera_.model.pinhole(X_VT * tag_corner(k, tag.edge_m)) +
                                 Eigen::Vector2d(noise_(random_), noise_(random_));
        out.ideal_from_raw[corner].setIdentity();
      }
      seen.tags.push_back(out);
    }
    log_.add(seen, X_WB, true_tags_);
  }
  ImagePlacement placement() const {
    return ImagePlacement({{&log_,
                            {camera_},
                            std::vector<CameraBelief>(1),
                            has_odometry_ ? &odometry_ : nullptr,
                            kNoise_px}});
  }
  void expect_there(const Pose& found, const Pose& truth, double within_m = kBranch_m) const {
    EXPECT_LT((found.p - truth.p).norm(), within_m);
    EXPECT_LT(angle_between(found.q, truth.q), kBranch_rad);
  }

  /// The true motion, in axes of its own.
  void add_odometry() {
    has_odometry_ = true;
    for (int i = 0; i < 40; ++i)
      odometry_.poses.push_back({instant_from_ns(1'000'000'000 + i * 100'000'000LL),
                                 kOfOdometry * true_poses_[static_cast<std::size_t>(i)]});
  }

  static inline const Pose kOfOdometry{exp_so3({0, 0, 0.7}), {3, -2, 1}};
  Odometry odometry_;
  bool has_odometry_{false};
  CameraMount camera_;
  ImageLog log_;
  std::mt19937 random_{11};
  std::normal_distribution<double> noise_{0, kNoise_px};
  std::vector<KnownTag> true_tags_;
  std::vector<Pose> true_poses_;
};

TEST_F(ImagePlacementTest, FromOneKnownTagAllTagsAndImagesFindTheirPlaces) {
  for (int i = 0; i < 40; ++i) {
    // Now and then the filter was on the wrong side of the wall's normal.
    const Pose wrong = Pose{exp_so3({0, 0.9, 0}), Eigen::Vector3d(1.5, 0, -0.5)} *
                       true_poses_[static_cast<std::size_t>(i)];
    see(i,
        i < 14   ? std::vector{0, 1}
        : i < 27 ? std::vector{1, 2}
                 : std::vector{2, 3},
        i % 8 == 3 ? std::optional(wrong) : std::nullopt);
  }
  ImagePlacement placement = this->placement();
  placement.hold(true_tags_[0]);
  EXPECT_TRUE(placement.settle());
  ASSERT_EQ(placement.tags().size(), 4U);
  for (const auto& [id, tag] : placement.tags())
    expect_there(tag.tag.X_WT, true_tags_[static_cast<std::size_t>(id)].X_WT);
  EXPECT_EQ(placement.tags().at(0).tag.X_WT.p, true_tags_[0].X_WT.p) << "it was given";
  for (std::size_t i = 0; i < 40; ++i) {
    EXPECT_EQ(placement.placed(0)[i].region, 0);
    expect_there(placement.placed(0)[i].X_WB, true_poses_[i]);
  }
  EXPECT_FALSE(placement.settle()) << "there is nothing new";
}

TEST_F(ImagePlacementTest, WhatSharesNoTagHasAxesOfItsOwn) {
  for (int i = 0; i < 40; ++i) see(i, i < 20 ? std::vector{0, 1} : std::vector{2, 3});
  ImagePlacement placement = this->placement();
  placement.hold(true_tags_[0]);
  const Pose elsewhere{exp_so3({0.1, 0.2, 0.3}), {1, 2, 3}};
  KnownTag known = true_tags_[2];
  known.X_WT = elsewhere * known.X_WT;
  placement.suggest(7, known);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 2);
  EXPECT_EQ(placement.tags().at(1).region, 0);
  EXPECT_EQ(placement.tags().at(3).region, 1);
  EXPECT_EQ(placement.placed(0)[5].region, 0);
  EXPECT_EQ(placement.placed(0)[25].region, 1);
  expect_there(placement.tags().at(3).tag.X_WT, elsewhere * true_tags_[3].X_WT);
}

TEST_F(ImagePlacementTest, OdometryTiesTagsTogetherThatAreNeverSeenTogether) {
  add_odometry();
  for (int i = 0; i < 40; ++i) see(i, {i / 10});
  ImagePlacement placement = this->placement();
  placement.hold(true_tags_[1]);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 1);
  ASSERT_EQ(placement.tags().size(), 4U);
  for (const auto& [id, tag] : placement.tags())
    expect_there(tag.tag.X_WT, true_tags_[static_cast<std::size_t>(id)].X_WT, kOneTag_m);
  for (std::size_t i = 0; i < 40; ++i)
    expect_there(placement.placed(0)[i].X_WB, true_poses_[i], kOneTag_m);
}

TEST_F(ImagePlacementTest, WhereNothingIsKnownOdometryBeginsAndTheReferenceTagSaysWhereThatIs) {
  add_odometry();
  for (int i = 0; i < 40; ++i) see(i, {i / 10});
  ImagePlacement placement = this->placement();
  EXPECT_TRUE(placement.settle());
  ASSERT_EQ(placement.tags().size(), 4U);
  expect_there(placement.tags().at(2).tag.X_WT, kOfOdometry * true_tags_[2].X_WT, kOneTag_m);
  placement.define_workspace({.reference_tag = 2, .X_WT = true_tags_[2].X_WT});
  for (const auto& [id, tag] : placement.tags())
    expect_there(tag.tag.X_WT, true_tags_[static_cast<std::size_t>(id)].X_WT, kOneTag_m);
  for (std::size_t i = 0; i < 40; ++i)
    expect_there(placement.placed(0)[i].X_WB, true_poses_[i], kOneTag_m);
  const Pose X_WT = placement.tags().at(0).tag.X_WT;
  placement.define_workspace({.reference_tag = 2, .X_WT = {}});
  EXPECT_EQ(placement.tags().at(0).tag.X_WT.p, X_WT.p) << "it is defined once";
}

TEST_F(ImagePlacementTest, TwoTagsThatNothingTiesToTheRestHaveAxesOfTheirOwn) {
  for (int i = 0; i < 40; ++i) see(i, i < 20 ? std::vector{0, 1} : std::vector{2, 3});
  ImagePlacement placement = this->placement();
  placement.hold(true_tags_[0]);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 2);
  EXPECT_EQ(placement.tags().at(2).region, 1);
  EXPECT_EQ(placement.tags().at(3).region, 1);
  const Pose X_23 = placement.tags().at(2).tag.X_WT.inverse() * placement.tags().at(3).tag.X_WT;
  expect_there(X_23, true_tags_[2].X_WT.inverse() * true_tags_[3].X_WT);
  const Pose over = true_tags_[2].X_WT * placement.tags().at(2).tag.X_WT.inverse();
  for (std::size_t i = 20; i < 40; ++i) {
    EXPECT_EQ(placement.placed(0)[i].region, 1);
    expect_there(over * placement.placed(0)[i].X_WB, true_poses_[i]);
  }
}

TEST_F(ImagePlacementTest, ALoneTagHasAxesOfItsOwnAndImagesThatShowAnotherJoinThem) {
  for (int i = 0; i < 40; ++i)
    see(i, i < 18 ? std::vector{0, 1} : i < 22 ? std::vector{1, 3} : std::vector{3});
  ImagePlacement placement = this->placement();
  placement.suggest(5, {3, true_tags_[3].edge_m, {}, Matrix6d::Zero()});
  placement.suggest(5, {2, true_tags_[2].edge_m, {}, Matrix6d::Zero()});
  placement.hold(true_tags_[0]);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.tags().at(3).region, 0) << "four images show it with one of the workspace";
  expect_there(placement.tags().at(3).tag.X_WT, true_tags_[3].X_WT, kOneTag_m);
  for (std::size_t i = 22; i < 40; ++i) EXPECT_EQ(placement.placed(0)[i].region, 0);
}

TEST_F(ImagePlacementTest, WhatIsSeenTooSeldomHasNoAxes) {
  for (int i = 0; i < 24; ++i) see(i, i < 20 ? std::vector{0, 1} : std::vector{3});
  ImagePlacement placement = this->placement();
  placement.hold(true_tags_[0]);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 1);
  EXPECT_FALSE(placement.tags().contains(3));
  EXPECT_EQ(placement.placed(0)[22].region, ImagePlacement::kNowhere);
}

TEST_F(ImagePlacementTest, ARoughSurveyBeginsWhereNothingElseDoes) {
  for (int i = 0; i < 40; ++i) see(i, i < 20 ? std::vector{0, 1} : std::vector{2, 3});
  ImagePlacement placement = this->placement();
  placement.hold(true_tags_[0]);
  KnownTag rough = true_tags_[2];
  rough.X_WT.p += Eigen::Vector3d(0.3, 0.2, -0.1);
  placement.survey(rough);
  EXPECT_TRUE(placement.settle());
  EXPECT_EQ(placement.regions(), 1);
  EXPECT_EQ(placement.placed(0)[25].region, 0);
  const Pose shift{Eigen::Quaterniond::Identity(), {0.3, 0.2, -0.1}};
  expect_there(placement.tags().at(3).tag.X_WT, shift * true_tags_[3].X_WT);
}

TEST_F(ImagePlacementTest, ATagInAWrongBranchIsPutRight) {
  for (int i = 0; i < 40; ++i) see(i, {0, 1, 2, 3});
  ImagePlacement placement = this->placement();
  for (int id = 0; id < 3; ++id) placement.suggest(0, true_tags_[static_cast<std::size_t>(id)]);
  KnownTag wrong = true_tags_[3];
  wrong.X_WT.q = wrong.X_WT.q * exp_so3({0.0, 0.9, 0.0});
  placement.suggest(0, wrong);
  EXPECT_TRUE(placement.settle());
  expect_there(placement.tags().at(3).tag.X_WT, true_tags_[3].X_WT);
}

TEST_F(ImagePlacementTest, LearnsTheNoiseOfTheCorners) {
  for (int i = 0; i < 40; ++i) see(i, {0, 1, 2, 3});
  ImagePlacement placement = this->placement();
  for (const KnownTag& tag : true_tags_) placement.hold(tag);
  (void)placement.settle();
  // Each image's pose takes 6 of its 32 numbers.
  EXPECT_NEAR(placement.learn_noise(0), kNoise_px * std::sqrt(26.0 / 32), 0.1 * kNoise_px);
}

TEST_F(ImagePlacementTest, ImagesWithoutATagThatIsKnownAreNowhere) {
  see(0, {0, 1});
  see(1, {});
  ImagePlacement placement = this->placement();
  EXPECT_FALSE(placement.settle());
  ASSERT_EQ(placement.placed(0).size(), 1U) << "images without tags are not logged";
  EXPECT_EQ(placement.placed(0)[0].region, ImagePlacement::kNowhere);
}

}  // namespace
}  // namespace fiducap
