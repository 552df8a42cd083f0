#include "capture/image_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "capture/camera_device.hpp"
#include "support/fake_clock.hpp"
#include "support/shared_data.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kRate_hz = 30;

/// A room: rectangles of many sizes on a gray wall, some of them black on white.
cv::Mat room(std::uint64_t seed = 1) {
  cv::RNG random(seed);
  cv::Mat image(480, 752, CV_8UC1, cv::Scalar(110));
  for (int i = 0; i < 120; ++i) {
    const cv::Point at(random.uniform(0, 740), random.uniform(0, 470));
    const cv::Size size(random.uniform(12, 90), random.uniform(12, 90));
    cv::rectangle(image, cv::Rect(at, size), cv::Scalar(random.uniform(20, 230)), cv::FILLED);
  }
  cv::GaussianBlur(image, image, {}, 0.7);
  return image;
}

class ImageWatchTest : public testing::Test {
 protected:
  using Change = std::function<void(cv::Mat&, int)>;

  /// Sensor noise that is another one in the next images.
  cv::Mat noisy(const cv::Mat& scene) {
    if (noise_.empty()) {
      for (int i = 0; i < 5; ++i) {
        cv::randn(noise_.emplace_back(scene.size(), CV_8UC1), 3, 2);
      }
    }
    cv::Mat image = scene + noise_[++noises_ % noise_.size()];
    return image;
  }
  static CameraFrame frame_of(const cv::Mat& image, Instant at) {
    auto gray = std::make_shared<GrayImage>();
    gray->resize(image.cols, image.rows);
    image.copyTo(cv::Mat(image.rows, image.cols, CV_8UC1, gray->pixels.data()));
    return {0, at, std::move(gray)};
  }
  void take(const CameraFrame& frame) {
    for (const ImageCondition& doubt : watch_.take(frame)) {
      told_.push_back(std::string(doubt.holds ? "+" : "-") + std::string(name_of(doubt.fault)));
      texts_ += doubt.text + "; " + doubt.remedy + "\n";
    }
  }
  /// Lets the camera run. @param change  what is wrong with image i; `before_` is the one before
  void run(double seconds, const Change& change = {}, double rate_hz = kRate_hz) {
    for (int i = 0; i < seconds * rate_hz; ++i) {
      cv::Mat image = noisy(scene_);
      if (change) change(image, i);
      now_ += from_seconds(1 / rate_hz);
      take(frame_of(image, now_));
      before_ = image;
    }
  }

  ImageWatch watch_{{{752, 480}, kRate_hz}};
  cv::Mat scene_{room()};
  cv::Mat before_;
  std::vector<cv::Mat> noise_;
  std::size_t noises_{0};
  Instant now_{};
  std::vector<std::string> told_;
  std::string texts_;
};

TEST_F(ImageWatchTest, NothingIsSaidOfAGoodCameraEvenIfItStandsStill) {
  run(20);
  EXPECT_THAT(told_, IsEmpty()) << texts_;
}

TEST_F(ImageWatchTest, ADarkRoomIsSaidToBeTooDarkAndNothingElse) {
  run(5, [](cv::Mat& image, int) { image *= 0.08; });
  EXPECT_THAT(told_, ElementsAre("+image_dark"));
  EXPECT_THAT(texts_, HasSubstr("too dark to see tags"));
  run(5);
  EXPECT_THAT(told_, ElementsAre("+image_dark", "-image_dark"));
}

TEST_F(ImageWatchTest, ACoveredLensWithoutAnyNoiseIsDarkAndNotFrozen) {
  run(5, [](cv::Mat& image, int) { image = cv::Scalar(0); });
  EXPECT_THAT(told_, ElementsAre("+image_dark"));
}

TEST_F(ImageWatchTest, AnOverexposedImageIsSaid) {
  run(5, [](cv::Mat& image, int) { image += 150; });
  EXPECT_THAT(told_, testing::Contains("+image_overexposed"));
}

TEST_F(ImageWatchTest, TheSameImageAgainAndAgainIsFrozen) {
  run(3);
  run(3, [this](cv::Mat& image, int) { image = before_; });
  EXPECT_THAT(told_, ElementsAre("+image_frozen"));
  run(6);
  EXPECT_THAT(told_, testing::Contains("-image_frozen"));
  EXPECT_THAT(told_, testing::Not(testing::Contains("-image_dark")));
}

TEST_F(ImageWatchTest, EverySecondImageTwiceIsDuplicated) {
  run(6, [this](cv::Mat& image, int i) {
    if (i % 2 == 1) image = before_;
  });
  EXPECT_THAT(told_, ElementsAre("+image_duplicated"));
  EXPECT_THAT(texts_, HasSubstr("repeat the one before with a new stamp"));
  run(15);
  EXPECT_THAT(told_, ElementsAre("+image_duplicated", "-image_duplicated"));
}

TEST_F(ImageWatchTest, ImagesWhoseLowerPartIsOneGrayAreHalf) {
  run(10, [](cv::Mat& image, int i) {
    if (i % 10 == 0) image.rowRange(300, 480) = 128;
  });
  EXPECT_THAT(told_, ElementsAre("+image_half"));
  run(60);
  EXPECT_THAT(told_, ElementsAre("+image_half", "-image_half"));
}

TEST_F(ImageWatchTest, ImagesThatEndWithTheOneBeforeAreHalf) {
  run(10, [this](cv::Mat& image, int i) {
    if (i % 10 == 9) before_.rowRange(240, 480).copyTo(image.rowRange(240, 480));
  });
  EXPECT_THAT(told_, ElementsAre("+image_half"));
}

TEST_F(ImageWatchTest, AFloorThatIsMerelyBlackIsNoHalfImage) {
  run(5, [](cv::Mat& image, int) {
    image.rowRange(400, 480) = 0;
    for (int u = 0; u < 752; u += 40)  // ragged: furniture stands on it
      image.colRange(u, u + 20).rowRange(380, 400) = 0;
  });
  EXPECT_THAT(told_, IsEmpty()) << texts_;
}

TEST_F(ImageWatchTest, MemoryThatWasNeverFilledIsAHalfImage) {
  run(10, [](cv::Mat& image, int i) {
    if (i % 10 == 0) image.rowRange(300, 480) = 0;
  });
  EXPECT_THAT(told_, ElementsAre("+image_half"));
}

TEST_F(ImageWatchTest, AnotherSizeIsSaidAtOnceWithBoth) {
  run(0.2, [](cv::Mat& image, int) { cv::resize(image, image, {376, 240}); });
  EXPECT_THAT(told_, ElementsAre("+image_size"));
  EXPECT_THAT(texts_, HasSubstr("376 x 240, expected are 752 x 480"));
}

TEST_F(ImageWatchTest, HalfTheRateIsSaidAndTheRateWithinATenthIsNot) {
  run(10, {}, 27);
  EXPECT_THAT(told_, IsEmpty()) << texts_;
  run(20, {}, 15);
  EXPECT_THAT(told_, ElementsAre("+image_rate"));
  EXPECT_THAT(texts_, HasSubstr("images a second instead of 30.0"));
  run(20);
  EXPECT_THAT(told_, ElementsAre("+image_rate", "-image_rate"));
}

TEST_F(ImageWatchTest, ACameraThatWasUnpluggedIsNoSlowOne) {
  run(10);
  now_ += std::chrono::seconds(60);
  run(10);
  EXPECT_THAT(told_, IsEmpty()) << texts_;
}

TEST_F(ImageWatchTest, ATenthOfImagesLostIsSaid) {
  for (int i = 0; i < 300; ++i) {
    const bool after_gap = i % 9 == 0;
    now_ += from_seconds((after_gap ? 2 : 1) / kRate_hz);
    CameraFrame frame = frame_of(noisy(scene_), now_);
    frame.lost_before = after_gap;
    take(frame);
  }
  EXPECT_THAT(told_, ElementsAre("+image_lost"));
}

TEST_F(ImageWatchTest, AnUnfocusedLensIsSaid) {
  run(3);
  run(15, [](cv::Mat& image, int) { cv::GaussianBlur(image, image, {}, 4); });
  EXPECT_THAT(told_, testing::Contains("+image_unfocused"));
  EXPECT_THAT(texts_, HasSubstr("out of focus"));
  run(15);
  EXPECT_THAT(told_, testing::Contains("-image_unfocused"));
  EXPECT_EQ(watch_.holds(ImageFault::kUnfocused), false);
}

TEST_F(ImageWatchTest, MotionThatSmearsEverySecondImageIsSaid) {
  run(15, [](cv::Mat& image, int i) {
    if (i % 2 == 0) cv::blur(image, image, {15, 1});
  });
  EXPECT_THAT(told_, ElementsAre("+image_motion_blur"));
  run(30);
  EXPECT_THAT(told_, ElementsAre("+image_motion_blur", "-image_motion_blur"));
}

TEST_F(ImageWatchTest, AWallWithoutEdgesSaysNothingOfTheLens) {
  scene_ = cv::Scalar(120);
  run(10);
  EXPECT_THAT(told_, IsEmpty()) << texts_;
}

TEST_F(ImageWatchTest, RealPicturesAreSharpAndBlurredOnesAreNot) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  for (const char* name :
       {"apriltag_repo/33369213973_9d9bb4cc96_c.jpg", "apriltag_repo/34085369442_304b6bafd9_c.jpg",
        "duckietown/test_image_multiple_01.png", "duckietown/test_image_rotation_0.png"}) {
    const cv::Mat image = cv::imread((*data / "detector" / name).string(), cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(image.empty()) << name;
    cv::Mat blurred;
    cv::GaussianBlur(image, blurred, {}, 3);
    const auto sharp = traits_of(*frame_of(image, {}).image);
    const auto smeared = traits_of(*frame_of(blurred, {}).image);
    EXPECT_GT(std::min(sharp.across, sharp.down), 0.65) << name;
    EXPECT_LT(std::max(smeared.across, smeared.down), 0.5) << name;
    EXPECT_EQ(sharp.missing, 0) << name;
  }
}

TEST_F(ImageWatchTest, NothingIsSaidOfTheFieldVideo) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  CameraDeviceConfig config;
  config.open = (*data / "detector/wpical/fieldvideo_long.mp4").string();
  config.paced = false;
  const FakeClock clock;
  const auto video = open_camera_device(config, CameraModel{}, clock);
  ASSERT_TRUE(video);
  watch_ = ImageWatch({{1920, 1080}, 0});
  for (auto sample = (*video)->next({}); sample && *sample; sample = (*video)->next({}))
    take(std::get<CameraFrame>(**sample));
  EXPECT_THAT(told_, IsEmpty()) << texts_;
}

}  // namespace
}  // namespace fiducap
