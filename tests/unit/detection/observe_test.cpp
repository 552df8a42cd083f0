#include "detection/observe.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace fiducap {
namespace {

class Observe : public testing::Test {
 protected:
  Observe() {
    camera_.width = 752;
    camera_.height = 480;
    camera_.fu = camera_.fv = 460;
    camera_.cu = 376;
    camera_.cv = 240;
    frame_.camera = 1;
    frame_.exposed_at = instant_from_ns(42);
    frame_.tags = {sighting(5), sighting(3)};
  }

  static TagSighting sighting(int id) {
    TagSighting s;
    s.tag_id = id;
    s.decision_margin = 60;
    s.corners_px = {Eigen::Vector2d{100, 160}, {150, 160}, {150, 110}, {100, 110}};
    return s;
  }

  const TagObservations& observed() {
    observe(frame_, camera_, tags_, detector_, out_);
    return out_;
  }

  CameraModel camera_;
  CornerFrame frame_;
  TagSetConfig tags_;
  DetectorConfig detector_;
  TagObservations out_;
};

TEST_F(Observe, ReturnsTagsSortedByIdWithTheirSizes) {
  tags_.sizes_m[3] = 0.3;
  ASSERT_EQ(observed().tags.size(), 2u);
  EXPECT_EQ(out_.tags[0].tag_id, 3);
  EXPECT_EQ(out_.tags[0].edge_m, 0.3);
  EXPECT_EQ(out_.tags[1].edge_m, 0.16);
  EXPECT_EQ(out_.camera, 1);
  EXPECT_EQ(out_.exposed_at, instant_from_ns(42));
}

TEST_F(Observe, UndistortsTheSameCornersWithAnotherLens) {
  TagObservation tag = observed().tags.front();
  camera_.fu = camera_.fv = 480;
  camera_.distortion = Distortion::kRadialTangential;
  camera_.coefficients = {-0.28, 0.07, 2e-4, 2e-5, 0};
  ASSERT_TRUE(undistort_tag(camera_, tag));
  const TagObservation& expected = observed().tags.front();
  EXPECT_GT((expected.corners_px[3] - sighting(3).corners_px[3]).norm(), 5) << "another lens";
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT((tag.corners_px[i] - expected.corners_px[i]).norm(), 1e-9);
    EXPECT_LT((tag.ideal_from_raw[i] - expected.ideal_from_raw[i]).norm(), 1e-9);
  }
}

TEST_F(Observe, UndistortsTrackedPointsOfThisImageOnly) {
  camera_.distortion = Distortion::kRadialTangential;
  camera_.coefficients = {-0.28, 0.07, 2e-4, 2e-5, 0};
  frame_.points = {{7, 3, {60, 400}}, {9, 0, {376, 240}}};
  ASSERT_EQ(observed().points.size(), 2u);
  EXPECT_EQ(out_.points[0].track, 7u);
  EXPECT_EQ(out_.points[0].age, 3);
  EXPECT_EQ(out_.points[0].px, undistort(camera_, {60, 400})->px);
  EXPECT_EQ(out_.points[0].ideal_from_raw, undistort(camera_, {60, 400})->ideal_from_raw);
  frame_.points.clear();
  EXPECT_TRUE(observed().points.empty());
}

TEST_F(Observe, DropsIgnoredIds) {
  tags_.ignore = {3};
  ASSERT_EQ(observed().tags.size(), 1u);
  EXPECT_EQ(out_.tags[0].tag_id, 5);
}

TEST_F(Observe, DropsBothOfADoubledId) {
  frame_.tags.push_back(sighting(3));
  ASSERT_EQ(observed().tags.size(), 1u);
  EXPECT_EQ(out_.tags[0].tag_id, 5);
}

TEST_F(Observe, DropsSightingsWithLowMarginOrManyCorrectedBits) {
  frame_.tags[0].decision_margin = 10;
  frame_.tags[1].hamming = 4;
  EXPECT_TRUE(observed().tags.empty());
}

TEST_F(Observe, AMarginOfZeroMeansThatTheSourceHasNone) {
  frame_.tags[0].decision_margin = 0;
  EXPECT_EQ(observed().tags.size(), 2u);
}

TEST_F(Observe, DropsTagsSeenFromBehindOrTwisted) {
  std::swap(frame_.tags[0].corners_px[0], frame_.tags[0].corners_px[1]);
  frame_.tags[1].corners_px[2].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(observed().tags.empty());
}

CameraModel wide_lens() {
  CameraModel c;
  c.width = 752;
  c.height = 480;
  c.fu = 458.6;
  c.fv = 457.3;
  c.cu = 367.2;
  c.cv = 248.4;
  c.distortion = Distortion::kRadialTangential;
  c.coefficients = {-0.283, 0.074, 0.0002, 0.00002, 0};
  return c;
}

const std::array<Eigen::Vector2d, 4> kSquareNearTheEdge{
    Eigen::Vector2d{600, 420}, {700, 415}, {705, 320}, {605, 318}};

TEST(SideBend, ALensBiasesFittedCorners) {
  const CameraModel camera = wide_lens();
  const auto fitted = corners_of_fitted_sides(camera, kSquareNearTheEdge);
  ASSERT_TRUE(fitted);
  double worst = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& px = kSquareNearTheEdge[i];
    const auto raw =
        camera.project({(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv, 1.0});
    worst = std::max(worst, ((*fitted)[i] - *raw).norm());
  }
  EXPECT_GT(worst, 0.1) << "there is nothing to correct";
}

TEST(SideBend, UnbendingReturnsTheTrueCorners) {
  const CameraModel camera = wide_lens();
  const auto corrected =
      unbend_corners(camera, *corners_of_fitted_sides(camera, kSquareNearTheEdge));
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& px = kSquareNearTheEdge[i];
    const auto raw =
        camera.project({(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv, 1.0});
    EXPECT_LT((corrected[i] - *raw).norm(), 5e-3);
  }
}

TEST(SideBend, WithoutALensNothingChanges) {
  CameraModel camera = wide_lens();
  camera.distortion = Distortion::kNone;
  EXPECT_EQ(unbend_corners(camera, kSquareNearTheEdge), kSquareNearTheEdge);
}

}  // namespace
}  // namespace fiducap
