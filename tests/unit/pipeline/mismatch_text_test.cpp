#include "pipeline/doubts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

using Kind = FoundMismatch::Kind;
using testing::HasSubstr;

Instant at_s(double seconds) { return Instant{} + from_seconds(seconds); }

std::vector<CameraMount> one_camera() {
  CameraMount mount;
  mount.model.fu = 460;
  mount.model.cu = 376;
  mount.model.cv = 240;
  return {mount};
}

struct Words {
  FoundMismatch found;
  std::vector<const char*> parts;
};

class MismatchText : public testing::TestWithParam<Words> {};

TEST_P(MismatchText, SaysWhatHowMuchAndWhatToDo) {
  const std::string text = mismatch_text(GetParam().found, one_camera());
  for (const char* part : GetParam().parts) EXPECT_THAT(text, HasSubstr(part));
}

INSTANTIATE_TEST_SUITE_P(
    AllKinds, MismatchText,
    testing::Values(
        Words{{Kind::kFocalLength, 0, -1, 0.009, 0.001},
              {"camera 0", "0.9 ± 0.1 % longer", "fu 460.0, seems 464.1", "calibrate camera",
               "estimator.refine_intrinsics: true"}},
        Words{{Kind::kCentreU, 0, -1, -4.2, 0.3}, {"4.2 ± 0.3 px left", "cu 376.0, seems 371.8"}},
        Words{{Kind::kCentreV, 0, -1, 3.0, 0.3}, {"3.0 ± 0.3 px below", "cv 240.0"}},
        Words{{Kind::kLens, 0, -1, 0.08, 0.002, {{0.08, {5, -3}}, 0.002, {1.5, 1.25}}},
              {"camera 0", "refined", "fu 496.8 ± 0.9 (configured 460.0)",
               "cu 381.0 ± 1.5 (configured 376.0)", "cv 237.0 ± 1.2 (configured 240.0). Run",
               "calibrate camera", ": its distortion stays"}},
        Words{{Kind::kLens, 0, -1, 0.08, 0.002, {{0.08, {5, -3}, -0.05}, 0.002, {1.5, 1.25}, 3e-3}},
              {"k1 -0.0500 ± 0.0030 (configured 0.0000)", "the rest of its distortion"}},
        Words{{Kind::kDistortion, 0, -1, -0.05, 0.002},
              {"camera 0", "k1 seems -0.0500 ± 0.0020, configured 0.0000", "calibrate camera"}},
        Words{{Kind::kReadout, 0, -1, 0.0151, 0.0004}, {"15.1 ± 0.4 ms", "readout_s"}},
        Words{{Kind::kAllPrints, -1, -1, 0.021, 0.002}, {"2.1 ± 0.2 % larger", "tags.size_m"}},
        Words{{Kind::kOnePrint, -1, 12, -0.03, 0.004},
              {"tag 12", "3.0 ± 0.4 % smaller", "sizes_m"}},
        Words{{Kind::kImuNoise, -1, -1, 5.1, 0.2}, {"5.1 times as noisy", "calibrate imu"}},
        Words{{Kind::kGyroRange, -1, -1, 8.73, 0}, {"gyro", "8.7 rad/s", "wider range"}},
        Words{{Kind::kAccelRange, -1, -1, 39.2, 0}, {"accelerometer", "39 m/s²"}},
        Words{{Kind::kStampJitter, -1, -1, 0.0031, 0}, {"jitter by 3.1 ms"}}));

const FoundMismatch kPrints{Kind::kAllPrints, -1, -1, 0.02, 0.002};

TEST(MismatchReporter, SaysWhatLastsOnce) {
  MismatchReporter news;
  EXPECT_TRUE(news.take({kPrints}, at_s(0)).empty());
  EXPECT_TRUE(news.take({kPrints}, at_s(1)).empty());
  EXPECT_EQ(news.take({kPrints}, at_s(3)).size(), 1u);
  for (int t = 4; t < 100; ++t) EXPECT_TRUE(news.take({kPrints}, at_s(t)).empty());
}

TEST(MismatchReporter, DoesNotSayWhatDoesNotLast) {
  MismatchReporter news;
  for (int t = 0; t < 100; t += 2) {
    EXPECT_TRUE(news.take({kPrints}, at_s(t)).empty());
    EXPECT_TRUE(news.take({}, at_s(t + 1)).empty());
  }
}

TEST(MismatchReporter, SaysItAgainWhenItHasChangedForGood) {
  MismatchReporter news;
  (void)news.take({kPrints}, at_s(0));
  ASSERT_EQ(news.take({kPrints}, at_s(3)).size(), 1u);
  FoundMismatch more = kPrints;
  more.value = 0.04;
  EXPECT_TRUE(news.take({more}, at_s(4)).empty());
  EXPECT_EQ(news.take({more}, at_s(8)).size(), 1u);
  EXPECT_TRUE(news.take({more}, at_s(9)).empty());
}

TEST(RefinedLensText, NamesOnlyWhatIsRefined) {
  FoundMismatch lens{Kind::kLens, 0, -1, 0, 0};
  lens.lens.offset.k1 = -0.05;
  lens.lens.k1_sigma = 0.003;
  const std::string text = mismatch_text(lens, one_camera());
  EXPECT_THAT(text, HasSubstr("the lens is refined: k1 -0.0500 ± 0.0030 (configured 0.0000). Run"));
}

TEST(MismatchReporter, SaysOfARefinedLensOnlyThatItHasMovedBeyondItsSigma) {
  MismatchReporter news;
  FoundMismatch lens{Kind::kLens, 0, -1, 1e-3, 2e-3};
  lens.lens.focal_sigma = 2e-3;
  (void)news.take({lens}, at_s(0));
  ASSERT_EQ(news.take({lens}, at_s(3)).size(), 1u);
  lens.lens.offset.focal = -1e-3;
  lens.lens.offset.k1 = 1e-7;  // it is held, not refined
  for (int t = 4; t < 20; ++t) EXPECT_TRUE(news.take({lens}, at_s(t)).empty());
  lens.lens.offset.focal = 0.02;
  EXPECT_EQ(news.take({lens}, at_s(30)).size(), 1u);
}

TEST(MismatchReporter, SaysOfARefinedLensThatItsDistortionHasMoved) {
  MismatchReporter news;
  FoundMismatch lens{Kind::kLens, 0, -1, 0, 0};
  lens.lens.k1_sigma = 0.01;
  (void)news.take({lens}, at_s(0));
  ASSERT_EQ(news.take({lens}, at_s(3)).size(), 1u);
  lens.lens.offset.k1 = 0.03;
  for (int t = 4; t < 20; ++t) EXPECT_TRUE(news.take({lens}, at_s(t)).empty());
  lens.lens.offset.k1 = -0.05;
  EXPECT_EQ(news.take({lens}, at_s(30)).size(), 1u);
}

TEST(MismatchReporter, SaysOfARefinedLensThatItsDistortionIsKnownNow) {
  MismatchReporter news;
  FoundMismatch lens{Kind::kLens, 0, -1, 0, 0};
  lens.lens.k1_sigma = 0.09;
  (void)news.take({lens}, at_s(0));
  ASSERT_EQ(news.take({lens}, at_s(3)).size(), 1u);
  lens.lens.offset.k1 = -0.1;
  lens.lens.k1_sigma = 0.01;
  (void)news.take({lens}, at_s(4));
  EXPECT_EQ(news.take({lens}, at_s(8)).size(), 1u);
}

TEST(MismatchReporter, KeepsCamerasAndTagsApart) {
  MismatchReporter news;
  const FoundMismatch one{Kind::kOnePrint, -1, 1, 0.02, 0.002};
  const FoundMismatch other{Kind::kOnePrint, -1, 2, 0.02, 0.002};
  (void)news.take({one, other}, at_s(0));
  EXPECT_EQ(news.take({one, other}, at_s(3)).size(), 2u);
}

}  // namespace
}  // namespace fiducap
