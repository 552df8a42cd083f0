#include "simulation/images/image_camera.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "still_camera.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::simulation {
namespace {

constexpr int kBlack = 28;
constexpr int kWhite = 212;

int at(const GrayImage& image, int u, int v) {
  return image.pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) +
                      static_cast<std::size_t>(u)];
}

double spread(const std::vector<double>& values) {
  const double mean =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  double square = 0;
  for (const double value : values) square += (value - mean) * (value - mean);
  return std::sqrt(square / static_cast<double>(values.size()));
}

TEST(ImageCamera, PrintsTheBitsOfTheTagTheRightWayUp) {
  // 8 modules of 20 px across the edge: the whole print is 200 px wide and centred at (187.5,
  // 119.5).
  const double distance = 230.0 * 0.4 / 160;
  StillCamera camera(small_camera(), clean_settings());
  const auto image = camera.photograph(EvenMotion(facing_camera(distance)), {tag_at(3, 0.4)});
  const auto modules = TagFamily::named("tag36h11")->cells(3);
  for (int row = 0; row < 10; ++row) {
    for (int column = 0; column < 10; ++column) {
      const int u = 88 + 20 * column + 10;
      const int v = 20 + 20 * row + 10;
      EXPECT_EQ(at(*image, u, v),
                modules[static_cast<std::size_t>(10 * row + column)] > 0 ? kWhite : kBlack)
          << row << " " << column;
    }
  }
}

TEST(ImageCamera, AnEdgeInsideAPixelDividesItsGray) {
  // Tag edge 160.5 px wide: its left side is at 187.5 − 80.25 = 107.25, so pixel 107 (106.5..107.5)
  // is ¾ white.
  StillCamera camera(small_camera(), clean_settings());
  const auto image =
      camera.photograph(EvenMotion(facing_camera(230.0 * 0.4 / 160.5)), {tag_at(3, 0.4)});
  EXPECT_NEAR(at(*image, 107, 119), 0.75 * kWhite + 0.25 * kBlack, 184.0 / 16);
  EXPECT_EQ(at(*image, 106, 119), kWhite);
  EXPECT_EQ(at(*image, 108, 119), kBlack);
}

TEST(ImageCamera, NearTagsHideFarOnesWhateverTheirOrder) {
  StillCamera camera(small_camera(), clean_settings());
  const EvenMotion still(facing_camera(1.0));
  const RecordedTag far = tag_at(3, 0.4);
  const RecordedTag near = tag_at(9, 0.2, {0.01, 0, 0.3});
  const auto one = camera.photograph(still, {far, near});
  const auto other = camera.photograph(still, {near, far});
  EXPECT_EQ(one->pixels, other->pixels);
  const auto alone = camera.photograph(still, {near});
  EXPECT_EQ(at(*one, 190, 119), at(*alone, 190, 119));
}

TEST(ImageCamera, BacksAreNotDrawn) {
  StillCamera camera(small_camera(), clean_settings());
  const EvenMotion behind({Eigen::Quaterniond::Identity(), {0, 0, -1}});
  EXPECT_EQ(camera.photograph(behind, {tag_at(3, 0.4)})->pixels,
            camera.photograph(behind, {})->pixels);
}

TEST(ImageCamera, ATagThatReachesBehindTheCameraIsDrawnWhereItIsSeen) {
  // A wall of 4 m seen from 10 cm beside it: most of the paper is outside the image, some is behind
  // the camera.
  StillCamera camera(small_camera(), clean_settings());
  const Pose along{exp_so3({0, std::numbers::pi / 2, 0}), {0, 0, 0.1}};
  const auto with = camera.photograph(EvenMotion(along), {tag_at(3, 4.0)});
  const auto without = camera.photograph(EvenMotion(along), {});
  int different = 0;
  for (std::size_t i = 0; i < with->pixels.size(); ++i)
    different += with->pixels[i] != without->pixels[i] ? 1 : 0;
  EXPECT_GT(different, 10000);
  EXPECT_LT(different, 376 * 240 * 3 / 4);
}

TEST(ImageCamera, TheBackdropIsNotFlatAndMovesWithTheRoom) {
  StillCamera camera(small_camera(), clean_settings());
  const auto before = camera.photograph(EvenMotion(facing_camera(0)), {});
  std::vector<double> grays(before->pixels.begin(), before->pixels.end());
  EXPECT_GT(spread(grays), 8.0);
  // 5 m from the wall, 20 px to the side: 0.435 m.
  Pose aside = facing_camera(0);
  aside.p.x() += 20 * 5.0 / 230;
  const auto after = camera.photograph(EvenMotion(aside), {});
  double shifted = 0;
  double unshifted = 0;
  for (int v = 20; v < 220; ++v) {
    for (int u = 40; u < 330; ++u) {
      shifted += std::abs(at(*after, u, v) - at(*before, u + 20, v));
      unshifted += std::abs(at(*after, u, v) - at(*before, u, v));
    }
  }
  EXPECT_LT(shifted, 0.2 * unshifted);
}

/// Mean difference of neighbouring pixels.
double fine_contrast(const std::string& texture) {
  StillCamera camera(small_camera(), clean_settings(), texture);
  const auto image = camera.photograph(EvenMotion(facing_camera(0)), {});
  double sum = 0;
  for (int v = 0; v < 240; ++v) {
    for (int u = 1; u < 376; ++u) sum += std::abs(at(*image, u, v) - at(*image, u - 1, v));
  }
  return sum / (240 * 375);
}

TEST(ImageCamera, ASharpRoomShowsFinerThingsThanClutterAndAPlainOneNothing) {
  EXPECT_GT(fine_contrast("sharp"), 2 * fine_contrast("clutter"));
  EXPECT_LT(fine_contrast("plain"), 0.1 * fine_contrast("clutter"));
}

TEST(ImageCamera, ASharpRoomStandsWhereTheRaysSay) {
  // 5 m from the wall, 7 px to the side.
  StillCamera camera(small_camera(), clean_settings(), "sharp");
  const auto before = camera.photograph(EvenMotion(facing_camera(0)), {});
  Pose aside = facing_camera(0);
  aside.p.x() += 7 * 5.0 / 230;
  const auto after = camera.photograph(EvenMotion(aside), {});
  double shifted = 0;
  double beside = 0;
  for (int v = 20; v < 220; ++v) {
    for (int u = 40; u < 330; ++u) {
      shifted += std::abs(at(*after, u, v) - at(*before, u + 7, v));
      beside += std::abs(at(*after, u, v) - at(*before, u + 8, v));
    }
  }
  EXPECT_LT(shifted, 0.1 * beside);
}

TEST(ImageCamera, PixelNoiseHasItsSigmaAndDiffersFromImageToImage) {
  CameraSimulation settings = clean_settings();
  StillCamera clean(small_camera(), settings);
  settings.pixel_noise = 3;
  StillCamera noisy(small_camera(), settings);
  const EvenMotion still(facing_camera(1));
  const auto truth = clean.photograph(still, {});
  const auto first = noisy.photograph(still, {}, 1);
  const auto second = noisy.photograph(still, {}, 2);
  std::vector<double> error;
  std::vector<double> difference;
  for (std::size_t i = 0; i < truth->pixels.size(); ++i) {
    error.push_back(first->pixels[i] - static_cast<double>(truth->pixels[i]));
    difference.push_back(first->pixels[i] - static_cast<double>(second->pixels[i]));
  }
  EXPECT_NEAR(spread(error), 3.0, 0.1);
  EXPECT_NEAR(spread(difference), 3.0 * std::sqrt(2.0), 0.15);
}

TEST(ImageCamera, VignettingDarkensTheImageCorner) {
  CameraSimulation settings = clean_settings();
  StillCamera plain(small_camera(), settings);
  settings.vignetting = 0.3;
  StillCamera dark(small_camera(), settings);
  const EvenMotion still(facing_camera(1));
  const auto bright = plain.photograph(still, {});
  const auto dimmed = dark.photograph(still, {});
  EXPECT_NEAR(at(*dimmed, 0, 0), 0.7 * at(*bright, 0, 0), 1.0);
  EXPECT_NEAR(at(*dimmed, 188, 120), at(*bright, 188, 120), 1.0);
}

// Daylight for x > 0, four times the light of the rest.
constexpr double kSun = 4;
DaylightConfig sunny_side() { return {kSun, {0, -10, -10}, {1e4, 10, 10}}; }

TEST(ImageCamera, InDaylightForLongEverythingLooksAsItDoesInTheHall) {
  StillCamera hall(small_camera(), clean_settings());
  StillCamera outside(small_camera(), clean_settings(), "clutter",
                      {kSun, {-10, -10, -10}, {10, 10, 10}});
  const EvenMotion still(facing_camera(1));
  const auto image = outside.photograph(still, {tag_at(3, 0.4)});
  const auto expected = hall.photograph(still, {tag_at(3, 0.4)});
  for (std::size_t i = 0; i < image->pixels.size(); ++i)
    ASSERT_NEAR(image->pixels[i], expected->pixels[i], 1) << i;
}

TEST(ImageCamera, WhoComesOutIntoTheSunSeesWhiteUntilTheExposureFollows) {
  CameraSimulation settings = clean_settings();
  settings.exposure_lag_s = 0.4;
  StillCamera camera(small_camera(), settings, "clutter", sunny_side());
  // A tag 1 m into the sun; the camera has just come out, or came long ago.
  const auto print_at = [&](double speed_m_s) {
    Pose place = facing_camera(1);
    place.p.x() = 1;
    const auto image =
        camera.photograph(EvenMotion(place, {speed_m_s, 0, 0}), {tag_at(3, 0.4, {1, 0, 0})});
    // The border is black, the ring around it white.
    return std::pair(at(*image, 188 - 42, 120), at(*image, 188 - 52, 120));
  };
  const auto [early_black, early_white] = print_at(1000);
  EXPECT_NEAR(early_black, kSun * kBlack, 1);
  EXPECT_EQ(early_white, 255);
  const auto [late_black, late_white] = print_at(0.1);
  EXPECT_NEAR(late_black, kBlack, 1);
  EXPECT_NEAR(late_white, kWhite, 1);
}

TEST(ImageCamera, WhoComesInFromTheSunSeesNextToNothing) {
  CameraSimulation settings = clean_settings();
  StillCamera camera(small_camera(), settings, "clutter", sunny_side());
  Pose place = facing_camera(1);
  place.p.x() = -1;
  const auto image =
      camera.photograph(EvenMotion(place, {-1000, 0, 0}), {tag_at(3, 0.4, {-1, 0, 0})});
  EXPECT_NEAR(at(*image, 188 - 42, 120), kBlack / kSun, 1);
  EXPECT_NEAR(at(*image, 188 - 52, 120), kWhite / kSun, 1);
}

TEST(ImageCamera, SlicesGiveTheSameImageAsOnePiece) {
  CameraSimulation settings;
  StillCamera camera(small_lens_camera(), settings);
  const EvenMotion moving(facing_camera(1), {0.3, 0.2, 0}, {0.2, 0.5, 0.8});
  const std::vector<RecordedTag> tags{tag_at(3, 0.3, {-0.3, 0, 0}), tag_at(4, 0.3, {0.3, 0.1, 0})};
  const auto whole = camera.photograph(moving, tags);
  for (const int rows : {1, 7, 64})
    EXPECT_EQ(camera.photograph(moving, tags, 0, rows)->pixels, whole->pixels) << rows;
}

TEST(ImageCamera, MotionSmearsAnEdgeOverItsPath) {
  CameraSimulation settings = clean_settings();
  settings.exposure_s = 0.02;
  StillCamera camera(small_camera(), settings);
  // 1 m away at 2 m/s: 2 · 0.02 · 230 = 9.2 px. In the middle of the exposure the left side of the
  // edge is at 141.5.
  const auto image = camera.photograph(EvenMotion(facing_camera(1), {2, 0, 0}), {tag_at(3, 0.4)});
  EXPECT_NEAR(at(*image, 141, 119), 0.5 * (kWhite + kBlack), 15);
  EXPECT_GT(at(*image, 139, 119), at(*image, 141, 119) + 20);
  EXPECT_LT(at(*image, 144, 119), at(*image, 141, 119) - 20);
}

TEST(ImageCamera, ASteadyStreamAllocatesNothing) {
  CameraSimulation settings;
  StillCamera camera(small_lens_camera(), settings);
  const EvenMotion moving(facing_camera(1), {0.3, 0.2, 0}, {0.2, 0.5, 0.8});
  const std::vector<RecordedTag> tags{tag_at(3, 0.3, {-0.3, 0, 0}), tag_at(4, 0.3, {0.3, 0.1, 0})};
  (void)camera.photograph(moving, tags);
  const AllocationCounter counter;
  for (std::uint64_t k = 1; k < 4; ++k) (void)camera.photograph(moving, tags, k);
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap::simulation
