#include "capture/camera_device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "capture/lens/calibration_files.hpp"
#include "support/fake_clock.hpp"
#include "support/shared_data.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// MJPEG keeps the gray of a flat image to a few levels.
constexpr int kJpegError = 4;

class CameraDeviceTest : public testing::Test {
 protected:
  // Five flat images at 20 Hz, each 40 levels brighter than the one before.
  void SetUp() override {
    config_.open = (folder_.path() / "tiny.avi").string();
    cv::VideoWriter video(config_.open, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20,
                          cv::Size(64, 48));
    ASSERT_TRUE(video.isOpened());
    for (int i = 0; i < 5; ++i) video.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(40 * i)));
  }
  std::unique_ptr<SensorSource> open() {
    auto source = open_camera_device(config_, camera_, clock_);
    EXPECT_TRUE(source) << source.error().text();
    return std::move(source.value());
  }
  std::vector<CameraFrame> play(std::size_t at_most = 100) {
    const auto source = open();
    std::vector<CameraFrame> frames;
    while (frames.size() < at_most) {
      auto sample = source->next({});
      EXPECT_TRUE(sample);
      if (!sample || !*sample) break;
      frames.push_back(std::get<CameraFrame>(**sample));
    }
    return frames;
  }
  static std::vector<std::int64_t> stamps_ms(const std::vector<CameraFrame>& frames) {
    std::vector<std::int64_t> stamps;
    for (const CameraFrame& frame : frames) stamps.push_back(to_ns(frame.exposed_at) / 1'000'000);
    return stamps;
  }
  std::string error() {
    const auto source = open_camera_device(config_, camera_, clock_);
    return source ? "none" : source.error().text();
  }

  TemporaryFolder folder_;
  CameraDeviceConfig config_;
  CameraModel camera_{64, 48, 60, 60, 31.5, 23.5, Distortion::kNone, {}};
  FakeClock clock_{instant_from_ns(7'000'000'000)};
};

TEST_F(CameraDeviceTest, AFileGivesItsImagesInGray) {
  config_.paced = false;
  const auto frames = play();
  ASSERT_EQ(frames.size(), 5u);
  for (int i = 0; i < 5; ++i) {
    const GrayImage& image = *frames[static_cast<std::size_t>(i)].image;
    EXPECT_EQ(image.width, 64);
    EXPECT_EQ(image.height, 48);
    ASSERT_EQ(image.pixels.size(), 64u * 48u);
    EXPECT_NEAR(image.pixels[20 * 64 + 30], 40 * i, kJpegError);
  }
}

TEST_F(CameraDeviceTest, AnUnpacedFileHasTheTimesOfItsFrames) {
  config_.paced = false;
  EXPECT_THAT(stamps_ms(play()), ElementsAre(0, 50, 100, 150, 200));
  config_.time_shift = std::chrono::milliseconds(3);
  EXPECT_THAT(stamps_ms(play()), ElementsAre(3, 53, 103, 153, 203));
  EXPECT_EQ(clock_.now(), instant_from_ns(7'000'000'000)) << "nobody waited";
}

TEST_F(CameraDeviceTest, APacedFilePlaysOnTheClock) {
  const auto source = open();
  for (const int expected_ms : {7000, 7050, 7100, 7150, 7200}) {
    const auto sample = source->next({}).value().value();
    EXPECT_EQ(time_of(sample), instant_from_ns(expected_ms * 1'000'000LL));
    EXPECT_EQ(clock_.now(), time_of(sample));
  }
  EXPECT_FALSE(source->next({}).value());
}

TEST_F(CameraDeviceTest, TheConfiguredRateOverridesTheFiles) {
  config_.rate_hz = 10;
  EXPECT_THAT(stamps_ms(play()), ElementsAre(7000, 7100, 7200, 7300, 7400));
}

TEST_F(CameraDeviceTest, ALoopGoesOnWithStrictlyIncreasingStamps) {
  config_.loop = true;
  const auto frames = play(7);
  EXPECT_THAT(stamps_ms(frames), ElementsAre(7000, 7050, 7100, 7150, 7200, 7250, 7300));
  EXPECT_NEAR(frames[5].image->pixels[0], 0, kJpegError) << "the first image again";
}

TEST_F(CameraDeviceTest, AStopEndsAFile) {
  config_.loop = true;
  std::stop_source stop;
  const auto source = open();
  ASSERT_TRUE(source->next(stop.get_token()).value());
  stop.request_stop();
  EXPECT_FALSE(source->next(stop.get_token()).value());
}

TEST_F(CameraDeviceTest, ASizeThatIsNotTheCalibratedOneIsRefusedWithBothSizes) {
  camera_.width = 128;
  EXPECT_THAT(error(),
              testing::AllOf(HasSubstr("tiny.avi"), HasSubstr("64 x 48"), HasSubstr("128 x 48")));
}

TEST_F(CameraDeviceTest, WhatCannotBeOpenedIsNamed) {
  config_.open = "/nowhere/video.mp4";
  EXPECT_THAT(error(), HasSubstr("/nowhere/video.mp4: no such video file"));
  config_.open = "/dev/video250";
  EXPECT_THAT(error(), HasSubstr("/dev/video250: cannot be opened"));
  config_.open = "no_such_element_of_gstreamer ! appsink";
  EXPECT_THAT(error(), HasSubstr("no GStreamer pipeline"));
  config_.open = folder_.write("text.mp4", "this is no video, it is a line of text");
  EXPECT_THAT(error(), HasSubstr("is no video that OpenCV can read"));
}

TEST_F(CameraDeviceTest, ATruncatedFileGivesTheImagesBeforeTheCutAndEnds) {
  {
    cv::VideoWriter video(config_.open, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20,
                          cv::Size(64, 48));
    cv::Mat noise(48, 64, CV_8UC3);
    for (int i = 0; i < 60; ++i) {
      cv::randu(noise, 0, 255);
      video.write(noise);
    }
  }
  std::filesystem::resize_file(config_.open, std::filesystem::file_size(config_.open) / 2);
  const std::size_t images = play().size();
  EXPECT_GE(images, 20u);
  EXPECT_LE(images, 31u);
}

TEST_F(CameraDeviceTest, APipelineIsStampedInTheMiddleOfTheExposureBeforeItsArrival) {
  config_.open =
      "videotestsrc num-buffers=2 ! video/x-raw,format=GRAY8,width=64,height=48 ! "
      "appsink sync=false";
  config_.exposure_s = 0.010;
  config_.latency_s = 0.020;
  config_.time_shift = std::chrono::milliseconds(1);
  auto source = open_camera_device(config_, camera_, clock_);
  if (!source)
    GTEST_SKIP() << "GStreamer's base plugins are not installed: " << source.error().text();
  const auto sample = (*source)->next({}).value().value();
  EXPECT_EQ(time_of(sample), instant_from_ns(7'000'000'000 - 24'000'000));
  clock_.advance(std::chrono::milliseconds(50));
  EXPECT_TRUE((*source)->next({}).value());
  clock_.advance(std::chrono::milliseconds(50));
  const auto lost = (*source)->next({});
  ASSERT_FALSE(lost) << "a live camera that ends is lost, not finished";
  EXPECT_EQ(lost.error().code, ErrorCode::kClosed);
}

TEST_F(CameraDeviceTest, CheckNamesEveryBrokenRule) {
  CameraDeviceConfig config;
  config.width = 640;
  config.rate_hz = -1;
  config.latency_s = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::string> paths;
  for (const ConfigError& broken : config.check("camera.")) paths.push_back(broken.path);
  EXPECT_THAT(paths,
              ElementsAre("camera.open", "camera.height", "camera.rate_hz", "camera.latency_s"));
  EXPECT_TRUE(config_.check("").empty());
}

TEST_F(CameraDeviceTest, TheFieldVideoIsReadToItsEnd) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  config_.open = (*data / "detector/wpical/fieldvideo_long.mp4").string();
  config_.paced = false;
  camera_ = read_camera_calibration((*data / "detector/wpical/calibration_derived.json").string())
                .value();
  const auto source = open();
  int frames = 0;
  std::optional<Instant> last;
  for (auto sample = source->next({}); sample && *sample; sample = source->next({})) {
    if (last) {
      EXPECT_GT(time_of(**sample), *last);
    }
    last = time_of(**sample);
    ++frames;
  }
  EXPECT_EQ(frames, 159);
}

}  // namespace
}  // namespace fiducap
