// Guides through calibrations, the first rest in what was recorded, and the search for the time
// shift.
#include "calibration/guided/guides.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "calibration/extrinsics/loaded_samples.hpp"
#include "detection/tag_geometry.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

constexpr double kEdge_m = 0.16;
constexpr double kDegree = std::numbers::pi / 180;

/// A sheet with one tag before a camera of 640 x 480.
class LensGuideTest : public testing::Test {
 protected:
  /// The tag's middle at this pixel and distance, leaned about x and y.
  static CornerFrame seen(double u, double v, double distance_m, double lean_x = 0,
                          double lean_y = 0, double sharpness = 0.8) {
    const CameraModel camera{640, 480, 500, 500, 319.5, 239.5, Distortion::kNone, {}};
    const Eigen::Quaterniond facing(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
    const Pose X_VT{facing * Eigen::AngleAxisd(lean_x, Eigen::Vector3d::UnitX()) *
                        Eigen::AngleAxisd(lean_y, Eigen::Vector3d::UnitY()),
                    {(u - camera.cu) / camera.fu * distance_m,
                     (v - camera.cv) / camera.fv * distance_m, distance_m}};
    TagSighting tag{3, 0, 60.0};
    tag.sharpness = sharpness;
    for (int i = 0; i < 4; ++i)
      tag.corners_px[static_cast<std::size_t>(i)] = camera.pinhole(X_VT * tag_corner(i, kEdge_m));
    return {0, {}, {tag}};
  }
  /// Held there for two images: the first one might be of a moving sheet.
  bool hold(const CornerFrame& frame) {
    static_cast<void>(guide_.look(frame));
    return guide_.look(frame);
  }

  static CalibrationTargets targets() {
    CalibrationTargets out;
    out.tags.size_m = kEdge_m;
    return out;
  }
  LensGuide guide_{targets(), 640, 480};
};

TEST_F(LensGuideTest, MeasuresTheSlantOfASquare) {
  const auto cosine = [](double lean_x, double lean_y) {
    return slant_cosine(seen(320, 240, 2, lean_x, lean_y).tags[0].corners_px);
  };
  constexpr double kPerspective = 0.01;  // of a tag two metres away
  EXPECT_NEAR(cosine(0, 0), 1, kPerspective);
  EXPECT_NEAR(cosine(40 * kDegree, 0), std::cos(40 * kDegree), kPerspective);
  EXPECT_NEAR(cosine(0, -30 * kDegree), std::cos(30 * kDegree), kPerspective);
}

TEST_F(LensGuideTest, KeepsOnlySharpNewViewsOfAStillSheet) {
  EXPECT_THAT(guide_.progress().hint, HasSubstr("Move it to the upper left"));
  EXPECT_FALSE(guide_.look(seen(320, 240, 0.6))) << "it may be moving";
  EXPECT_TRUE(guide_.look(seen(320, 240, 0.6)));
  EXPECT_FALSE(guide_.look(seen(320, 240, 0.6))) << "not a new view";
  EXPECT_FALSE(guide_.look(seen(420, 240, 0.6)));
  EXPECT_THAT(guide_.progress().hint, HasSubstr("still"));
  EXPECT_TRUE(guide_.look(seen(420, 240, 0.6)));
  EXPECT_FALSE(hold(CornerFrame{}));
  EXPECT_THAT(guide_.progress().hint, HasSubstr("Show the sheet"));
  EXPECT_FALSE(hold(seen(520, 240, 0.6, 0, 0, 0.2)));
  EXPECT_THAT(guide_.progress().hint, HasSubstr("blurred"));
  EXPECT_EQ(guide_.progress().views, 2u);
}

TEST_F(LensGuideTest, IsEnoughOnlyWithCoverageAndSlants) {
  for (int v = 0; v < 6; ++v)
    for (int u = 0; u < 8; ++u) EXPECT_TRUE(hold(seen(40 + 80 * u, 40 + 80 * v, 0.9)));
  EXPECT_GE(guide_.progress().covered, 0.9);
  EXPECT_FALSE(guide_.progress().is_enough);
  EXPECT_THAT(guide_.progress().hint, HasSubstr("Slant"));
  for (int i = 0; i < 24; ++i)
    static_cast<void>(hold(seen(120 + 50 * (i % 8), 100 + 90 * (i / 8), 0.6, 40 * kDegree)));
  EXPECT_TRUE(guide_.progress().is_enough);
  guide_.request_more(5, "Nearer to the right border.");
  EXPECT_FALSE(guide_.progress().is_enough);
  EXPECT_EQ(guide_.progress().hint, "Nearer to the right border.");
}

TEST_F(LensGuideTest, NamesTheEmptyPartOfTheImage) {
  for (int v = 0; v < 6; ++v)
    for (int u = 0; u < 5; ++u) static_cast<void>(hold(seen(40 + 80 * u, 40 + 80 * v, 0.9, 0.7)));
  EXPECT_THAT(guide_.progress().hint, HasSubstr("right"));
}

ImuSample at_rest(int i, std::mt19937& random) {
  std::normal_distribution<double> normal;
  ImuSample sample{instant_from_ns(i * 5'000'000LL), {0.01, 0, 0}, {0, 0.2, 9.8}};
  for (int k = 0; k < 3; ++k) {
    sample.w_WB_B(k) += 0.002 * normal(random);
    sample.f_B(k) += 0.03 * normal(random);
  }
  return sample;
}

TEST(RestGuide, ReturnsTheNoiseAfterAMinute) {
  std::mt19937 random(3);
  RestGuide guide;
  EXPECT_THAT(guide.hint(), HasSubstr("No sample"));
  int i = 0;
  for (; !guide.is_enough(); ++i) guide.take(at_rest(i, random));
  EXPECT_NEAR(i, 200 * RestGuide::kLongEnough_s, 2);
  const auto noise = guide.result();
  ASSERT_TRUE(noise) << noise.error().text();
  // 0.002 rad/s at 200 Hz is 0.002 / sqrt(200) as a density; a minute determines a few percent.
  EXPECT_NEAR(noise->noise.gyro_noise_rad_s_rtHz, 0.002 / std::sqrt(200.0), 1e-5);
  EXPECT_NEAR(noise->noise.rate_hz, 200, 0.1);
}

TEST(RestGuide, RestartsAfterATouch) {
  std::mt19937 random(3);
  RestGuide guide;
  for (int i = 0; i < 4000; ++i) guide.take(at_rest(i, random));
  EXPECT_GT(guide.share(), 0.3);
  ImuSample touched = at_rest(4000, random);
  touched.w_WB_B.x() += 0.5;
  guide.take(touched);
  EXPECT_LT(guide.share(), 0.01);
  EXPECT_THAT(guide.hint(), HasSubstr("It moved"));
}

TEST(WaveGuide, NeedsRotationAboutAllAxesShakingAndTags) {
  WaveGuide guide;
  CornerFrame frame{0, {}, {TagSighting{1}}};
  int i = 0;
  const auto wave = [&](int axis, double seconds, double shaken, double turned = 1.5) {
    for (const int end = i + static_cast<int>(seconds * 200); i < end; ++i) {
      ImuSample sample{instant_from_ns(i * 5'000'000LL), {0, 0, 0}, {0, 0, 9.81}};
      sample.w_WB_B(axis) = turned * std::sin(i * 0.05);
      sample.f_B.x() = shaken * std::sin(i * 0.1);
      guide.take(sample);
      frame.exposed_at = sample.sampled_at;
      if (i % 10 == 0) guide.take(frame);
    }
  };
  const auto hold = [&](double seconds) { wave(0, seconds, 0, 0); };
  const auto hint = [&] { return guide.progress().hint; };
  wave(2, 10, 5);
  EXPECT_EQ(guide.progress().turned[2], 0);
  EXPECT_THAT(hint(), HasSubstr("Hold it still"));
  frame.tags.clear();
  hold(2);
  EXPECT_THAT(hint(), HasSubstr("Show tags"));
  frame.tags.push_back(TagSighting{1});
  hold(300);
  EXPECT_THAT(hint(), HasSubstr("Quickly back and forth"));
  EXPECT_EQ(guide.progress().seen, 0) << "counts from the wave on";
  EXPECT_LE(guide.samples().imu.size(), 600u) << "three seconds";
  EXPECT_LE(guide.samples().tags, 61);
  EXPECT_FALSE(guide.samples().begins_still);
  i += 200;  // a second without readings
  wave(2, 1, 5);
  EXPECT_FALSE(guide.samples().begins_still) << "unknown motion in the gap";
  hold(2);
  wave(2, 10, 0);
  EXPECT_TRUE(guide.samples().begins_still);
  EXPECT_FALSE(guide.progress().is_enough);
  EXPECT_EQ(guide.progress().turned[2], 1);
  EXPECT_THAT(hint(), HasSubstr("roll it"));
  wave(0, 10, 0);
  EXPECT_THAT(hint(), HasSubstr("pitch it"));
  wave(1, 10, 0);
  EXPECT_THAT(hint(), HasSubstr("Shake it"));
  wave(1, 15, 5);
  EXPECT_TRUE(guide.progress().is_enough) << hint();
  EXPECT_GT(guide.samples().frames.size(), 500u);
}

constexpr std::int64_t kStep_ns = 5'000'000;  // 200 Hz

/// A motion by hand, segment by segment; an image every tenth reading.
class Story {
 public:
  Story& hold(double seconds, bool shows_tags) { return add(seconds, 0, 0.3, shows_tags); }
  Story& swing(double seconds) { return add(seconds, 1.5, 4, true); }
  Story& pause(double seconds) {
    next_ns_ += static_cast<std::int64_t>(seconds * 1e9);
    return *this;
  }
  [[nodiscard]] Instant now() const { return instant_from_ns(next_ns_); }
  [[nodiscard]] const LoadedSamples& samples() const { return samples_; }

 private:
  Story& add(double seconds, double turned, double shaken, bool shows_tags) {
    const auto end = next_ns_ + static_cast<std::int64_t>(seconds * 1e9);
    for (; next_ns_ < end; next_ns_ += kStep_ns) {
      const double phase = 2 * M_PI * 0.9 * static_cast<double>(next_ns_) * 1e-9;
      ImuSample imu{now(), {0, turned * std::sin(phase), 0}, {0, 0, 9.81}};
      imu.f_B.x() += shaken * std::cos(phase);
      for (int k = 0; k < 3; ++k) {
        imu.w_WB_B(k) += kGyro_rad_s * normal_(random_);
        imu.f_B(k) += kAccel_m_s2 * normal_(random_);
      }
      samples_.imu.push_back(imu);
      if (samples_.imu.size() % 10 != 0) continue;
      samples_.frames.push_back({0, now(), {}});
      if (shows_tags) samples_.frames.back().tags.push_back(TagSighting{1});
    }
    return *this;
  }

  static constexpr double kGyro_rad_s = 0.05, kAccel_m_s2 = 0.4;  // a noisy phone's
  LoadedSamples samples_;
  std::int64_t next_ns_{0};
  std::mt19937_64 random_{7};
  std::normal_distribution<double> normal_;
};

TEST(StillnessDetector, FindsTheFirstRestWithTagsInView) {
  Story story;
  story.swing(3).hold(2, false).swing(2);
  const Instant before = story.now();
  story.hold(2, true).swing(5);
  const auto rest = value_of(first_rest(story.samples()));
  EXPECT_GT(rest, before);
  EXPECT_LT(rest, before + std::chrono::seconds(1));
}

TEST(StillnessDetector, FindsNoRestInContinuousMotionInShortPausesOrAcrossAGap) {
  EXPECT_FALSE(first_rest(Story().swing(20).samples()));
  EXPECT_FALSE(first_rest(Story().swing(3).hold(0.5, true).swing(3).samples()));
  EXPECT_FALSE(first_rest(Story().hold(5, false).swing(3).samples())) << "no tag in view";
  EXPECT_FALSE(first_rest({}));
  EXPECT_FALSE(first_rest(Story().hold(0.5, true).pause(0.5).hold(0.5, true).swing(3).samples()));
  EXPECT_TRUE(first_rest(Story().hold(0.5, true).pause(0.5).hold(0.9, true).samples()));
}

TEST(StillnessDetector, IgnoresInvalidReadings) {
  LoadedSamples samples = Story().hold(2, true).samples();
  samples.imu.front().f_B.setZero();  // first reading of some drivers
  samples.imu[100].w_WB_B.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(first_rest(samples));
}

}  // namespace
}  // namespace fiducap
