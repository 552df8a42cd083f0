#include "capture/image_watch.hpp"

#include <gmock/gmock.h>

#include <functional>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "capture/camera_device.hpp"
#include "support/fake_clock.hpp"
#include "support/results.hpp"
#include "support/shared_data.hpp"

namespace fiducap {
namespace {

using testing::Contains;
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

  /// With sensor noise, which differs from image to image.
  cv::Mat noisy(const cv::Mat& scene) {
    while (noise_.size() < 5) cv::randn(noise_.emplace_back(scene.size(), CV_8UC1), 3, 2);
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
      reported_.push_back(std::string(doubt.holds ? "+" : "-") + std::string(name_of(doubt.fault)));
      texts_ += doubt.text + "; " + doubt.remedy + "\n";
    }
  }
  /// Runs the camera. @param change  the fault of image i; `before_` is the image before
  void run(double seconds, const Change& change = {}, double rate_hz = kRate_hz) {
    for (int i = 0; i < seconds * rate_hz; ++i) {
      cv::Mat image = noisy(scene_);
      if (change) change(image, i);
      now_ += from_seconds(1 / rate_hz);
      take(frame_of(image, now_));
      before_ = image;
    }
  }

  /// @return what was reported since the last reset
  const std::vector<std::string>& reported(double seconds, const Change& change = {},
                                           double rate_hz = kRate_hz) {
    run(seconds, change, rate_hz);
    return reported_;
  }
  void reset() {
    watch_ = ImageWatch({{752, 480}, kRate_hz});
    reported_.clear();
    texts_.clear();
  }

  ImageWatch watch_{{{752, 480}, kRate_hz}};
  cv::Mat scene_{room()};
  cv::Mat before_;
  std::vector<cv::Mat> noise_;
  std::size_t noises_{0};
  Instant now_{};
  std::vector<std::string> reported_;
  std::string texts_;
};

TEST_F(ImageWatchTest, ReportsNothingOfAGoodCamera) {
  EXPECT_THAT(reported(20), IsEmpty()) << "at rest: " << texts_;
  reset();
  run(5, [](cv::Mat& image, int) {
    image.rowRange(400, 480) = 0;      // a black floor
    for (int u = 0; u < 752; u += 40)  // with furniture
      image.colRange(u, u + 20).rowRange(380, 400) = 0;
  });
  EXPECT_THAT(reported_, IsEmpty()) << texts_;
  reset();
  scene_ = cv::Scalar(120);  // a wall without edges
  EXPECT_THAT(reported(10), IsEmpty()) << texts_;
}

TEST_F(ImageWatchTest, ReportsDarkAndOverexposedImages) {
  EXPECT_THAT(reported(5, [](cv::Mat& image, int) { image *= 0.08; }), ElementsAre("+image_dark"));
  EXPECT_THAT(texts_, HasSubstr("too dark to see tags"));
  EXPECT_THAT(reported(5), ElementsAre("+image_dark", "-image_dark"));
  reset();
  EXPECT_THAT(reported(5, [](cv::Mat& image, int) { image = cv::Scalar(0); }),
              ElementsAre("+image_dark"))
      << "not frozen, though there is no noise";
  reset();
  EXPECT_THAT(reported(5, [](cv::Mat& image, int) { image += 150; }),
              Contains("+image_overexposed"));
}

TEST_F(ImageWatchTest, ReportsFrozenAndDuplicatedImages) {
  run(3);
  run(3, [this](cv::Mat& image, int) { image = before_; });
  EXPECT_THAT(reported_, ElementsAre("+image_frozen"));
  EXPECT_THAT(reported(6),
              testing::AllOf(Contains("-image_frozen"), testing::Not(Contains("-image_dark"))));
  reset();
  run(6, [this](cv::Mat& image, int i) {
    if (i % 2 == 1) image = before_;
  });
  EXPECT_THAT(reported_, ElementsAre("+image_duplicated"));
  EXPECT_THAT(texts_, HasSubstr("repeat the one before with a new stamp"));
  EXPECT_THAT(reported(15), ElementsAre("+image_duplicated", "-image_duplicated"));
}

TEST_F(ImageWatchTest, ReportsImagesThatAreFilledByHalf) {
  const std::pair<const char*, Change> kFaults[] = {
      {"the image before",
       [this](cv::Mat& image, int i) {
         if (i % 10 == 9) before_.rowRange(240, 480).copyTo(image.rowRange(240, 480));
       }},
      {"memory that was never filled",
       [](cv::Mat& image, int i) {
         if (i % 10 == 0) image.rowRange(300, 480) = 0;
       }},
      {"one gray", [](cv::Mat& image, int i) {
         if (i % 10 == 0) image.rowRange(300, 480) = 128;
       }}};
  for (const auto& [what, fault] : kFaults) {
    reset();
    run(10, fault);
    EXPECT_THAT(reported_, ElementsAre("+image_half")) << what;
  }
  EXPECT_THAT(reported(60), ElementsAre("+image_half", "-image_half"));
}

TEST_F(ImageWatchTest, ReportsAnotherSizeAtOnce) {
  run(0.2, [](cv::Mat& image, int) { cv::resize(image, image, {376, 240}); });
  EXPECT_THAT(reported_, ElementsAre("+image_size"));
  EXPECT_THAT(texts_, HasSubstr("376 x 240, expected are 752 x 480"));
}

TEST_F(ImageWatchTest, ReportsALowRateButNoInterruption) {
  run(10);
  now_ += std::chrono::seconds(60);  // unplugged
  EXPECT_THAT(reported(10), IsEmpty()) << texts_;
  reset();
  EXPECT_THAT(reported(10, {}, 27), IsEmpty()) << texts_;
  EXPECT_THAT(reported(20, {}, 15), ElementsAre("+image_rate"));
  EXPECT_THAT(texts_, HasSubstr("images a second instead of 30.0"));
  EXPECT_THAT(reported(20), ElementsAre("+image_rate", "-image_rate"));
}

TEST_F(ImageWatchTest, ReportsATenthOfImagesLost) {
  for (int i = 0; i < 300; ++i) {
    const bool after_gap = i % 9 == 0;
    now_ += from_seconds((after_gap ? 2 : 1) / kRate_hz);
    CameraFrame frame = frame_of(noisy(scene_), now_);
    frame.lost_before = after_gap;
    take(frame);
  }
  EXPECT_THAT(reported_, ElementsAre("+image_lost"));
}

TEST_F(ImageWatchTest, ReportsAnUnfocusedLens) {
  run(3);
  run(15, [](cv::Mat& image, int) { cv::GaussianBlur(image, image, {}, 4); });
  EXPECT_THAT(reported_, Contains("+image_unfocused"));
  EXPECT_THAT(texts_, HasSubstr("out of focus"));
  EXPECT_THAT(reported(15), Contains("-image_unfocused"));
  EXPECT_EQ(watch_.holds(ImageFault::kUnfocused), false);
}

TEST_F(ImageWatchTest, ReportsMotionBlur) {
  run(15, [](cv::Mat& image, int i) {
    if (i % 2 == 0) cv::blur(image, image, {15, 1});
  });
  EXPECT_THAT(reported_, ElementsAre("+image_motion_blur"));
  EXPECT_THAT(reported(30), ElementsAre("+image_motion_blur", "-image_motion_blur"));
}

TEST_F(ImageWatchTest, MeasuresTheSharpnessOfRealImages) {
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

TEST_F(ImageWatchTest, ReportsNothingOfTheFieldVideo) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  CameraDeviceConfig config;
  config.open = *data / "detector/wpical/fieldvideo_long.mp4";
  config.paced = false;
  const FakeClock clock;
  const auto video = value_of(open_camera_device(config, CameraModel{}, clock));
  watch_ = ImageWatch({{1920, 1080}, 0});
  int frames = 0;
  Instant last = instant_from_ns(-1);
  for (; const auto sample = value_of(video->next({})); ++frames) {
    EXPECT_GT(time_of(*sample), std::exchange(last, time_of(*sample)));
    take(std::get<CameraFrame>(*sample));
  }
  EXPECT_EQ(frames, 159);
  EXPECT_THAT(reported_, IsEmpty()) << texts_;
}

}  // namespace
}  // namespace fiducap
