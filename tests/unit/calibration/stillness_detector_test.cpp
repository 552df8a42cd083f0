#include "calibration/extrinsics/loaded_samples.hpp"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace fiducap {
namespace {

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
  const auto rest = first_rest(story.samples());
  ASSERT_TRUE(rest);
  EXPECT_GT(*rest, before);
  EXPECT_LT(*rest, before + std::chrono::seconds(1));
}

TEST(StillnessDetector, FindsNoRestInContinuousMotionOrInShortPauses) {
  EXPECT_FALSE(first_rest(Story().swing(20).samples()));
  EXPECT_FALSE(first_rest(Story().swing(3).hold(0.5, true).swing(3).samples()));
  EXPECT_FALSE(first_rest(Story().hold(5, false).swing(3).samples())) << "no tag in view";
  EXPECT_FALSE(first_rest({}));
}

TEST(StillnessDetector, IgnoresInvalidReadings) {
  LoadedSamples samples = Story().hold(2, true).samples();
  samples.imu.front().f_B.setZero();  // first reading of some drivers
  samples.imu[100].w_WB_B.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(first_rest(samples));
}

TEST(StillnessDetector, RestartsAfterAGap) {
  EXPECT_FALSE(first_rest(Story().hold(0.5, true).pause(0.5).hold(0.5, true).swing(3).samples()));
  EXPECT_TRUE(first_rest(Story().hold(0.5, true).pause(0.5).hold(0.9, true).samples()));
}

}  // namespace
}  // namespace fiducap
