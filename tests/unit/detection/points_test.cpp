// Tracked points, on rendered rooms and on synthetic images.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "detection/points/feature_points.hpp"
#include "detection/points/point_tracker.hpp"
#include "drawn_tag.hpp"
#include "support/allocation_counter.hpp"
#include "unit/simulation/still_camera.hpp"

namespace fiducap {
namespace {

/// Smooth hills of a few pixels, shifted. Their tops are at (4.5 + 18 i, 3.9 + 15.7 k).
std::shared_ptr<const GrayImage> hills(double du, double dv, int width = 160, int height = 120) {
  auto image = std::make_shared<GrayImage>();
  image->resize(width, height);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const double gray = 120 + 50 * std::sin(0.35 * (u - du)) + 50 * std::sin(0.4 * (v - dv));
      image->pixels[static_cast<std::size_t>(v * width + u)] =
          static_cast<std::uint8_t>(std::lround(gray));
    }
  }
  return image;
}

ImagePyramid pyramid_of(std::shared_ptr<const GrayImage> image) {
  ImagePyramid pyramid;
  pyramid.build(std::move(image));
  return pyramid;
}

TEST(ImagePyramid, AveragesFourPixelsOfTheLevelBefore) {
  auto image = std::make_shared<GrayImage>();
  image->resize(8, 8);
  for (std::size_t i = 0; i < 64; ++i) image->pixels[i] = static_cast<std::uint8_t>(3 * i);
  const ImagePyramid pyramid = pyramid_of(image);
  ASSERT_EQ(pyramid.level(1).width, 4);
  ASSERT_EQ(pyramid.level(2).height, 2);
  EXPECT_EQ(pyramid.level(0).pixels, image->pixels.data());
  // Pixels 18, 19, 26, 27 times three.
  EXPECT_EQ(pyramid.level(1).row(1)[1], 68);
}

TEST(PatchFlow, FindsAShiftBetweenPixels) {
  const ImagePyramid from = pyramid_of(hills(0, 0));
  const ImagePyramid to = pyramid_of(hills(3.37, -2.61));
  constexpr double kBetween_px = 0.05;  // of integer grays and linear interpolation
  for (const Eigen::Vector2d& px : {Eigen::Vector2d(76, 67), {58.6, 51.4}, {94.1, 82.3}}) {
    const auto found = patch_flow::follow(from, px, to, px).value();
    EXPECT_LT((found - px - Eigen::Vector2d(3.37, -2.61)).norm(), kBetween_px);
  }
}

TEST(PatchFlow, RejectsFlatAndDifferentPatchesAndTheBorder) {
  const auto image = hills(0, 0);
  auto other = std::make_shared<GrayImage>(*image);
  for (int v = 50; v < 70; ++v)
    for (int u = 70; u < 90; ++u)
      other->pixels[static_cast<std::size_t>(v * 160 + u)] = (u + v) % 2 == 0 ? 20 : 220;
  const ImagePyramid blank = pyramid_of(std::make_shared<GrayImage>(white_wall(160, 120)));
  EXPECT_FALSE(patch_flow::follow(blank, {80, 60}, blank, {80, 60}));
  const ImagePyramid a = pyramid_of(image);
  EXPECT_FALSE(patch_flow::follow(a, {4, 60}, a, {4, 60}));
  EXPECT_FALSE(patch_flow::follow(a, {80, 60}, a, {80, 117}));
  EXPECT_FALSE(patch_flow::follow(a, {80, 60}, a, {std::nan(""), 60}));
  EXPECT_FALSE(patch_flow::follow(a, {80, 60}, pyramid_of(other), {80, 60}));
}

TEST(CornerFinder, FindsTheCornerOfASquareAndNotItsSides) {
  GrayImage image = white_wall(80, 60, 0);
  draw_square(image, 50, 30, 30, 200);
  CornerFinder finder;
  const auto anywhere = [](int, int) { return true; };
  const auto left_half = [](int u, int) { return u < 40; };
  const auto found = finder.best(image, {5, 5, 75, 55}, 9, anywhere).value();
  EXPECT_LT((found - Eigen::Vector2d(49.5, 29.5)).norm(), 0.3);
  EXPECT_FALSE(finder.best(image, {60, 20, 75, 40}, 9, anywhere));  // a side only
  EXPECT_FALSE(finder.best(image, {5, 5, 75, 55}, 9, left_half));
}

TEST(TranslationConsensus, KeepsStaticPointsAndDropsMovingOnes) {
  const Eigen::Vector3d shift(0.2, -0.05, 0.1);
  std::vector<RotatedPair> pairs;
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector3d p(std::sin(1.7 * i) * 2, std::cos(2.9 * i), 3 + i % 5);
    const Eigen::Vector3d later = p - shift;
    pairs.push_back({p / p.z(), later / later.z()});
    if (i % 3 == 0)
      pairs.back().now += Eigen::Vector3d(0.02 * std::cos(i), 0.03 + 0.01 * std::sin(i), 0);
  }
  TranslationConsensus check;
  const auto fits = check.inliers(pairs, 0.002);
  int kept_movers = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    kept_movers += i % 3 == 0 ? fits[i] : 0;
    EXPECT_TRUE(i % 3 == 0 || fits[i] == 1) << i;
  }
  EXPECT_LE(kept_movers, 1);  // one may move along its own epipolar line
}

TEST(TranslationConsensus, KeepsAllUnderPureRotation) {
  std::vector<RotatedPair> pairs;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d ray(std::sin(1.7 * i), std::cos(2.9 * i), 1);
    pairs.push_back(
        {ray, ray + Eigen::Vector3d(3e-4 * std::sin(5.0 * i), 3e-4 * std::cos(3.0 * i), 0)});
  }
  TranslationConsensus check;
  for (const char fits : check.inliers(pairs, 0.002)) EXPECT_EQ(fits, 1);
}

/// A camera that moves before a textured wall at a distance of 5 m.
class PointTrackerTest : public testing::Test {
 protected:
  static constexpr double kStep_m = 0.03;

  static simulation::CameraSimulation settings(double noise) {
    auto s = simulation::clean_settings();
    s.pixel_noise = noise;
    return s;
  }

  Pose X_WV(int k) const {
    Pose X = simulation::facing_camera(0);
    X.p.x() += kStep_m * k;
    X.q = X.q * exp_so3({0, 0.004 * k, 0.01 * k});
    return X;
  }

  CameraFrame photograph(int k, const std::vector<RecordedTag>& tags = {}) {
    CameraFrame frame;
    frame.exposed_at = instant_from_ns(50'000'000LL * k);
    frame.image =
        camera_.photograph(simulation::EvenMotion(X_WV(k)), tags, static_cast<std::uint64_t>(k));
    return frame;
  }

  std::span<const PointSighting> follow(int k, std::span<const TagSighting> tags = {},
                                        const std::vector<RecordedTag>& printed = {}) {
    std::optional<Eigen::Quaterniond> turn;
    if (k > 0) turn = X_WV(k - 1).q.conjugate() * X_WV(k).q;
    return tracker_.follow(photograph(k, printed), simulation::small_camera(), turn, tags);
  }

  simulation::StillCamera camera_{simulation::small_camera(), settings(1.0), "sharp"};
  PointTracker tracker_;
};

TEST_F(PointTrackerTest, TracksPointsToAFractionOfAPixel) {
  // First position of each track, on the wall z = −5.
  std::map<std::uint32_t, Eigen::Vector3d> places;
  double squares = 0;
  int count = 0;
  int oldest = 0;
  const CameraModel model = simulation::small_camera();
  for (int k = 0; k < 21; ++k) {
    for (const PointSighting& point : follow(k)) {
      const Eigen::Vector3d ray =
          X_WV(k).q * Eigen::Vector3d((point.px.x() - model.cu) / model.fu,
                                      (point.px.y() - model.cv) / model.fv, 1);
      if (point.age == 0) {
        places[point.track] = X_WV(k).p + (-5 - X_WV(k).p.z()) / ray.z() * ray;
        continue;
      }
      ASSERT_TRUE(places.contains(point.track));
      const Eigen::Vector2d truth = model.pinhole(X_WV(k).inverse() * places[point.track]);
      squares += (point.px - truth).squaredNorm();
      count += 2;
      oldest = std::max(oldest, point.age);
    }
  }
  ASSERT_GT(count, 200);
  EXPECT_GE(oldest, 8);
  EXPECT_LT(std::sqrt(squares / count), 0.25);
}

TEST_F(PointTrackerTest, BoundsAndSpreadsItsPoints) {
  for (int k = 0; k < 13; ++k) {
    const auto points = follow(k);
    EXPECT_LE(points.size(), PointTracker::kMost);
    for (std::size_t i = 1; i < points.size(); ++i) EXPECT_LT(points[i - 1].track, points[i].track);
  }
  (void)follow(13);
  const auto points = follow(14);
  ASSERT_GT(points.size(), 15u);
  std::set<std::pair<int, int>> thirds;
  for (const PointSighting& point : points)
    thirds.insert({static_cast<int>(point.px.x() / 126), static_cast<int>(point.px.y() / 81)});
  EXPECT_GE(thirds.size(), 8u);
}

TEST_F(PointTrackerTest, ReportsPointsOfEverySecondImage) {
  EXPECT_FALSE(follow(0).empty());
  EXPECT_TRUE(follow(1).empty());
  std::set<int> ages;
  for (const PointSighting& point : follow(2)) ages.insert(point.age);
  EXPECT_TRUE(ages.contains(1));
  EXPECT_LE(*ages.rbegin(), 1);
}

TEST_F(PointTrackerTest, HasNoPointsOnTags) {
  RecordedTag tag = simulation::tag_at(3, 1.2, {0.1, 0, -4.9});
  TagSighting seen;
  const auto corners = simulation::corners_of(tag);
  for (int k = 0; k < 5; ++k) {
    for (std::size_t i = 0; i < 4; ++i)
      seen.corners_px[i] = *simulation::small_camera().project(X_WV(k).inverse() * corners[i]);
    for (const PointSighting& point : follow(k, std::span(&seen, 1), {tag})) {
      const Eigen::Vector2d middle = 0.5 * (seen.corners_px[0] + seen.corners_px[2]);
      const double reach = 0.5 * (seen.corners_px[0] - seen.corners_px[2]).norm() / std::sqrt(2.0);
      EXPECT_GT((point.px - middle).cwiseAbs().maxCoeff(), reach + 4) << "image " << k;
    }
  }
}

TEST_F(PointTrackerTest, FindsNoPointsInAnImageWithoutStructure) {
  simulation::StillCamera blank(simulation::small_camera(), settings(3.0), "plain");
  for (int k = 0; k < 5; ++k) {
    CameraFrame frame;
    frame.image =
        blank.photograph(simulation::EvenMotion(X_WV(k)), {}, static_cast<std::uint64_t>(k));
    EXPECT_LE(tracker_.follow(frame, simulation::small_camera(), std::nullopt, {}).size(), 2u);
  }
}

TEST_F(PointTrackerTest, RestartsWhenTheImageSizeChanges) {
  (void)follow(0);
  (void)follow(1);
  CameraFrame frame;
  frame.image = hills(0, 0);
  const auto points = tracker_.follow(frame, {160, 120, 100, 100, 80, 60}, std::nullopt, {});
  for (const PointSighting& point : points) EXPECT_EQ(point.age, 0);
}

TEST_F(PointTrackerTest, AllocatesNothingAfterWarmUp) {
  std::vector<CameraFrame> frames;
  for (int k = 0; k < 20; ++k) {
    frames.push_back(photograph(k));  // with its own image: the list of the pool grows
    frames.back().image = std::make_shared<GrayImage>(*frames.back().image);
  }
  std::uint64_t after_warm_up = 0;
  for (int k = 0; k < 20; ++k) {
    const Eigen::Quaterniond turn = X_WV(std::max(0, k - 1)).q.conjugate() * X_WV(k).q;
    const AllocationCounter allocations;
    (void)tracker_.follow(frames[static_cast<std::size_t>(k)], simulation::small_camera(), turn,
                          {});
    if (k >= 10) after_warm_up += allocations.count();
  }
  EXPECT_EQ(after_warm_up, 0u);
}

}  // namespace
}  // namespace fiducap
