#include "simulation/images/image_camera.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "robot.hpp"
#include "still_camera.hpp"
#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"

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

class ImageCameraTest : public testing::Test {
 protected:
  std::shared_ptr<const GrayImage> photograph(const Pose& X_WV,
                                              const std::vector<RecordedTag>& tags = {}) {
    return camera_.photograph(EvenMotion(X_WV), tags);
  }
  StillCamera camera_{small_camera(), clean_settings()};
};

TEST_F(ImageCameraTest, DrawsTheBitsOfTheTagUpright) {
  // 8 modules of 20 px across the edge: the print is 200 px wide and centred at (187.5, 119.5).
  const auto image = photograph(facing_camera(230.0 * 0.4 / 160), {tag_at(3, 0.4)});
  const auto modules = TagFamily::named("tag36h11")->cells(3);
  for (int row = 0; row < 10; ++row) {
    for (int column = 0; column < 10; ++column) {
      const bool is_white = modules[static_cast<std::size_t>(10 * row + column)] > 0;
      EXPECT_EQ(at(*image, 98 + 20 * column, 30 + 20 * row), is_white ? kWhite : kBlack)
          << row << " " << column;
    }
  }
}

TEST_F(ImageCameraTest, DividesTheGrayOfAPixelAtAnEdge) {
  // Tag edge 160.5 px wide: its left side is at 187.5 − 80.25 = 107.25, so pixel 107 (106.5..107.5)
  // is ¾ white.
  const auto image = photograph(facing_camera(230.0 * 0.4 / 160.5), {tag_at(3, 0.4)});
  EXPECT_NEAR(at(*image, 107, 119), 0.75 * kWhite + 0.25 * kBlack, 184.0 / 16);
  EXPECT_EQ(at(*image, 106, 119), kWhite);
  EXPECT_EQ(at(*image, 108, 119), kBlack);
}

TEST_F(ImageCameraTest, HidesFarTagsBehindNearOnesAndDrawsNoneFromBehind) {
  const Pose X_WV = facing_camera(1.0);
  const RecordedTag far = tag_at(3, 0.4);
  const RecordedTag near = tag_at(9, 0.2, {0.01, 0, 0.3});
  const auto image = photograph(X_WV, {far, near});
  EXPECT_EQ(image->pixels, photograph(X_WV, {near, far})->pixels);
  EXPECT_EQ(at(*image, 190, 119), at(*photograph(X_WV, {near}), 190, 119));
  const Pose behind{Eigen::Quaterniond::Identity(), {0, 0, -1}};
  EXPECT_EQ(photograph(behind, {tag_at(3, 0.4)})->pixels, photograph(behind)->pixels);
}

TEST_F(ImageCameraTest, DrawsTheVisiblePartOfATagThatReachesBehind) {
  // A wall of 4 m at a distance of 10 cm along the view: most of it is outside of the image, some
  // behind the camera.
  const Pose along{exp_so3({0, std::numbers::pi / 2, 0}), {0, 0, 0.1}};
  const auto with = photograph(along, {tag_at(3, 4.0)});
  const auto without = photograph(along);
  int different = 0;
  for (std::size_t i = 0; i < with->pixels.size(); ++i)
    different += with->pixels[i] != without->pixels[i] ? 1 : 0;
  EXPECT_GT(different, 10000);
  EXPECT_LT(different, 376 * 240 * 3 / 4);
}

TEST_F(ImageCameraTest, AddsPixelNoiseWithItsSigma) {
  CameraSimulation settings = clean_settings();
  settings.pixel_noise = 3;
  StillCamera noisy(small_camera(), settings);
  const EvenMotion still(facing_camera(1));
  const auto truth = camera_.photograph(still, {});
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

TEST_F(ImageCameraTest, DarkensImageCornersByVignetting) {
  CameraSimulation settings = clean_settings();
  settings.vignetting = 0.3;
  StillCamera dark(small_camera(), settings);
  const auto bright = photograph(facing_camera(1));
  const auto dimmed = dark.photograph(EvenMotion(facing_camera(1)), {});
  EXPECT_NEAR(at(*dimmed, 0, 0), 0.7 * at(*bright, 0, 0), 1.0);
  EXPECT_NEAR(at(*dimmed, 188, 120), at(*bright, 188, 120), 1.0);
}

// Daylight for x > 0, four times the light of the rest.
constexpr double kSun = 4;
DaylightConfig sunny_side() { return {kSun, {0, -10, -10}, {1e4, 10, 10}}; }

TEST_F(ImageCameraTest, AdaptsItsExposureToDaylight) {
  StillCamera outside(small_camera(), clean_settings(), "clutter",
                      {kSun, {-10, -10, -10}, {10, 10, 10}});
  const auto image = outside.photograph(EvenMotion(facing_camera(1)), {tag_at(3, 0.4)});
  const auto expected = photograph(facing_camera(1), {tag_at(3, 0.4)});
  for (std::size_t i = 0; i < image->pixels.size(); ++i)
    ASSERT_NEAR(image->pixels[i], expected->pixels[i], 1) << i;
}

TEST(ImageCamera, IsWronglyExposedAfterAChangeOfLight) {
  CameraSimulation settings = clean_settings();
  settings.exposure_lag_s = 0.4;
  // A tag at this x; black of its border and white of the ring around it.
  const auto print_at = [&](double x, double speed_m_s) {
    StillCamera camera(small_camera(), settings, "clutter", sunny_side());
    Pose place = facing_camera(1);
    place.p.x() = x;
    const auto image =
        camera.photograph(EvenMotion(place, {speed_m_s, 0, 0}), {tag_at(3, 0.4, {x, 0, 0})});
    return std::pair(at(*image, 188 - 42, 120), at(*image, 188 - 52, 120));
  };
  const auto [early_black, early_white] = print_at(1, 1000);  // has just come into the sun
  EXPECT_NEAR(early_black, kSun * kBlack, 1);
  EXPECT_EQ(early_white, 255);
  const auto [late_black, late_white] = print_at(1, 0.1);  // came long ago
  EXPECT_NEAR(late_black, kBlack, 1);
  EXPECT_NEAR(late_white, kWhite, 1);
  settings = clean_settings();
  const auto [dark_black, dark_white] = print_at(-1, -1000);  // has just come out of the sun
  EXPECT_NEAR(dark_black, kBlack / kSun, 1);
  EXPECT_NEAR(dark_white, kWhite / kSun, 1);
}

/// A camera that moves before two tags.
struct MovingScene {
  StillCamera camera{small_lens_camera(), CameraSimulation{}};
  EvenMotion motion{facing_camera(1), {0.3, 0.2, 0}, {0.2, 0.5, 0.8}};
  std::vector<RecordedTag> tags{tag_at(3, 0.3, {-0.3, 0, 0}), tag_at(4, 0.3, {0.3, 0.1, 0})};
};

TEST(ImageCamera, DrawsTheSameImageInSlices) {
  MovingScene moving;
  const auto whole = moving.camera.photograph(moving.motion, moving.tags);
  for (const int rows : {1, 7, 64})
    EXPECT_EQ(moving.camera.photograph(moving.motion, moving.tags, 0, rows)->pixels, whole->pixels)
        << rows;
}

TEST(ImageCamera, BlursEdgesByMotion) {
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

constexpr Instant kStart = instant_from_ns(1'000'000'000);

SimulatedBodyConfig robot_with_images(double duration_s) {
  SimulatedBodyConfig body = corner_robot("survey");
  body.cameras[0].model = {188, 120, 115, 115, 93.5, 59.5};
  body.cameras.push_back(body.cameras[0]);
  body.camera.images = true;
  body.trajectory.duration_s = duration_s;
  return body;
}

std::unique_ptr<SimulatedSource> source_of(const SimulatedBodyConfig& body,
                                           const Clock* clock = nullptr) {
  return make_simulated_source(room_of("hall"), body, kStart, clock).value();
}

TEST(SimulatedImages, AreEqualWhenDrawnAheadOrAtOnce) {
  SimulatedBodyConfig body = robot_with_images(3);
  body.faults.drop_image = 0.2;
  body.faults.jitter_s = 0.01;
  body.faults.occlude = 0.2;
  const FakeClock clock(kStart);
  const auto a = run_out(*source_of(body, &clock));
  const auto b = run_out(*source_of(body));
  ASSERT_EQ(a.size(), b.size());
  int images = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(time_of(a[i]), time_of(b[i]));
    ASSERT_EQ(a[i].index(), b[i].index());
    if (!std::holds_alternative<CameraFrame>(a[i])) continue;
    ++images;
    ASSERT_EQ(std::get<CameraFrame>(a[i]).camera, std::get<CameraFrame>(b[i]).camera);
    ASSERT_EQ(std::get<CameraFrame>(a[i]).image->pixels, std::get<CameraFrame>(b[i]).image->pixels);
  }
  EXPECT_GT(images, 80);
}

TEST(SimulatedImages, DoNotAffectTheImu) {
  SimulatedBodyConfig body = robot_with_images(1);
  const auto with = only<ImuSample>(run_out(*source_of(body)));
  body.camera.images = false;
  const auto without = only<ImuSample>(run_out(*source_of(body)));
  ASSERT_EQ(with.size(), without.size());
  for (std::size_t k = 0; k < with.size(); ++k) {
    EXPECT_EQ(with[k].f_B, without[k].f_B);
    EXPECT_EQ(with[k].w_WB_B, without[k].w_WB_B);
  }
}

TEST(SimulatedImages, AllocateNothingAfterWarmUp) {
  const FakeClock clock(kStart);
  const auto source = source_of(robot_with_images(0), &clock);
  const auto run_until = [&](double t_s) {
    int images = 0;
    for (;;) {
      const auto sample = source->next({});
      images += std::holds_alternative<CameraFrame>(**sample) ? 1 : 0;
      if (to_seconds(time_of(**sample) - kStart) > t_s) return images;
    }
  };
  (void)run_until(100);  // once around the hall: every tag was printed
  const AllocationCounter counter;
  EXPECT_GT(run_until(130), 1000);
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap::simulation
