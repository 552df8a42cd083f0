#include "capture/camera_device.hpp"

#include <gmock/gmock.h>

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "support/fake_clock.hpp"
#include "support/temporary_folder.hpp"
#include "unit/capture/sample_stamps.hpp"

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
    cv::VideoWriter video = new_video();
    for (int i = 0; i < 5; ++i) video.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(40 * i)));
  }
  cv::VideoWriter new_video() const {
    cv::VideoWriter video(config_.open, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20,
                          cv::Size(64, 48));
    EXPECT_TRUE(video.isOpened());
    return video;
  }
  std::unique_ptr<SensorSource> open() {
    return value_of(open_camera_device(config_, camera_, clock_));
  }
  std::vector<CameraFrame> play(std::size_t at_most = 100) {
    std::vector<CameraFrame> frames;
    for (const SensorSample& sample : play_all(*open(), at_most))
      frames.push_back(std::get<CameraFrame>(sample));
    return frames;
  }
  std::string error() { return error_of(open_camera_device(config_, camera_, clock_)); }

  TemporaryFolder folder_;
  CameraDeviceConfig config_{.open = folder_.file("tiny.avi")};
  CameraModel camera_{64, 48, 60, 60, 31.5, 23.5};
  FakeClock clock_{instant_from_ns(7'000'000'000)};
};

TEST_F(CameraDeviceTest, PlaysAFileInGrayWithTheTimesOfItsFrames) {
  config_.paced = false;
  const auto frames = play();
  EXPECT_THAT(stamps_ms(frames), ElementsAre(0, 50, 100, 150, 200));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const GrayImage& image = *frames[i].image;
    EXPECT_EQ(image.width, 64);
    EXPECT_EQ(image.height, 48);
    ASSERT_EQ(image.pixels.size(), 64u * 48u);
    EXPECT_NEAR(image.pixels[20 * 64 + 30], 40.0 * static_cast<double>(i), kJpegError);
  }
  config_.time_shift = std::chrono::milliseconds(3);
  EXPECT_THAT(stamps_ms(play()), ElementsAre(3, 53, 103, 153, 203));
  EXPECT_EQ(clock_.now(), instant_from_ns(7'000'000'000)) << "without waiting";
}

TEST_F(CameraDeviceTest, PlaysOnTheClockWhenPaced) {
  const auto source = open();
  for (const int expected_ms : {7000, 7050, 7100, 7150, 7200}) {
    const auto sample = source->next({}).value().value();
    EXPECT_EQ(time_of(sample), instant_from_ns(expected_ms * 1'000'000LL));
    EXPECT_EQ(clock_.now(), time_of(sample));
  }
  EXPECT_FALSE(source->next({}).value());
}

TEST_F(CameraDeviceTest, PlaysAFileAtTheConfiguredRate) {
  config_.rate_hz = 10;
  EXPECT_THAT(stamps_ms(play()), ElementsAre(7000, 7100, 7200, 7300, 7400));
}

TEST_F(CameraDeviceTest, LoopsWithIncreasingStamps) {
  config_.loop = true;
  const auto frames = play(7);
  EXPECT_THAT(stamps_ms(frames), ElementsAre(7000, 7050, 7100, 7150, 7200, 7250, 7300));
  EXPECT_NEAR(frames[5].image->pixels[0], 0, kJpegError) << "the first image again";
}

TEST_F(CameraDeviceTest, StopsWhenRequested) {
  config_.loop = true;
  std::stop_source stop;
  const auto source = open();
  ASSERT_TRUE(source->next(stop.get_token()).value());
  stop.request_stop();
  EXPECT_FALSE(source->next(stop.get_token()).value());
}

TEST_F(CameraDeviceTest, RefusesASizeOtherThanTheCalibrated) {
  camera_.width = 128;
  EXPECT_THAT(error(),
              testing::AllOf(HasSubstr("tiny.avi"), HasSubstr("64 x 48"), HasSubstr("128 x 48")));
}

TEST_F(CameraDeviceTest, NamesWhatCannotBeOpened) {
  config_.open = "/nowhere/video.mp4";
  EXPECT_THAT(error(), HasSubstr("/nowhere/video.mp4: no such video file"));
  config_.open = "/dev/video250";
  EXPECT_THAT(error(), HasSubstr("/dev/video250: cannot be opened"));
  config_.open = "no_such_element_of_gstreamer ! appsink";
  EXPECT_THAT(error(), HasSubstr("no GStreamer pipeline"));
  config_.open = folder_.write("text.mp4", "this is no video, it is a line of text");
  EXPECT_THAT(error(), HasSubstr("is no video that OpenCV can read"));
}

TEST_F(CameraDeviceTest, PlaysATruncatedFileUpToTheCut) {
  {
    cv::VideoWriter video = new_video();
    cv::Mat noise(48, 64, CV_8UC3);
    for (int i = 0; i < 60; ++i) {
      cv::randu(noise, 0, 255);
      video.write(noise);
    }
  }
  std::filesystem::resize_file(config_.open, std::filesystem::file_size(config_.open) / 2);
  EXPECT_THAT(play().size(), testing::AllOf(testing::Ge(20u), testing::Le(31u)));
}

TEST_F(CameraDeviceTest, StampsAPipelineByArrivalLessLatencyAndExposure) {
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
  EXPECT_THAT(paths_of(config.check("camera.")),
              ElementsAre("camera.open", "camera.height", "camera.rate_hz", "camera.latency_s"));
  EXPECT_TRUE(config_.check("").empty());
}

}  // namespace
}  // namespace fiducap
