#include "capture/camera_device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <linux/videodev2.h>
#include <opencv2/imgcodecs.hpp>

#include "base/log.hpp"
#include "support/allocation_counter.hpp"
#include "support/simulated_camera.hpp"

namespace fiducap::v4l2 {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// Kernel stamps are of whole microseconds.
constexpr Duration kStampRounding = std::chrono::microseconds(1);

class V4l2CameraTest : public testing::Test {
 protected:
  V4l2CameraTest() {
    camera_.offers = {{V4L2_PIX_FMT_YUYV, {64, 48}, 30, 30}, {V4L2_PIX_FMT_GREY, {64, 48}, 60, 60}};
    camera_.knobs[V4L2_CID_EXPOSURE_ABSOLUTE] = {"Exposure Time, Absolute", 1, 5000, 80};
    said_before_ = log::lines_after(0).empty() ? 0 : log::lines_after(0).back().number;
  }
  void open() {
    auto opened = open_v4l2_camera(camera_.open(), "/dev/video7", config_, model_, clock_);
    ASSERT_TRUE(opened) << opened.error().text();
    source_ = std::move(*opened);
  }
  std::string error_of_opening() {
    auto opened = open_v4l2_camera(camera_.open(), "/dev/video7", config_, model_, clock_);
    return opened ? "none" : opened.error().text();
  }
  CameraFrame next() {
    auto sample = source_->next({});
    EXPECT_TRUE(sample) << sample.error().text();
    return sample && *sample ? std::get<CameraFrame>(**sample) : CameraFrame{};
  }
  /// All that was said since the test began.
  std::string said() const {
    std::string all;
    for (const log::Line& line : log::lines_after(said_before_)) all += line.text + "\n";
    return all;
  }
  static std::int64_t us(Instant at) { return to_ns(at) / 1000; }
  /// When image `number` ended, by a clock that had `start` when the last stream began.
  std::uint32_t number_of(const CameraFrame& frame) const { return frame.image->pixels[0]; }

  FakeClock clock_{instant_from_ns(100'000'000'000)};
  SimulatedCamera camera_{clock_};
  CameraDeviceConfig config_;
  CameraModel model_;
  std::unique_ptr<SensorSource> source_;
  std::uint64_t said_before_{0};
};

TEST_F(V4l2CameraTest, TheQuickestFormatIsUsedAndTheOthersAreNamed) {
  open();
  EXPECT_EQ(camera_.mode.code, V4L2_PIX_FMT_GREY);
  EXPECT_THAT(said(), HasSubstr("/dev/video7 (Simulated): GREY 64 x 48 at 60.0 Hz measured; also "
                                "offers YUYV (30.0 Hz nominal)"));
  EXPECT_EQ(camera_.streams, 1) << "what promises less than was measured is not tried";
}

TEST_F(V4l2CameraTest, WhatPromisesMuchAndDeliversLittleIsNotUsed) {
  camera_.offers = {{V4L2_PIX_FMT_GREY, {64, 48}, 60, 12}, {V4L2_PIX_FMT_YUYV, {64, 48}, 30, 30}};
  open();
  EXPECT_EQ(camera_.mode.code, V4L2_PIX_FMT_YUYV);
  EXPECT_THAT(said(), HasSubstr("YUYV 64 x 48 at 30.0 Hz measured; also offers GREY (12.0 Hz "
                                "measured)"));
}

TEST_F(V4l2CameraTest, OfEqualRatesGrayIsUsed) {
  camera_.offers = {{V4L2_PIX_FMT_MJPEG, {64, 48}, 30, 30},
                    {V4L2_PIX_FMT_YUYV, {64, 48}, 30, 30},
                    {V4L2_PIX_FMT_GREY, {64, 48}, 29.97, 29.97}};
  open();
  EXPECT_EQ(camera_.mode.code, V4L2_PIX_FMT_GREY);
}

TEST_F(V4l2CameraTest, AConfiguredFormatIsUsedThoughItIsSlower) {
  config_.format = "YUYV";
  open();
  EXPECT_EQ(camera_.mode.code, V4L2_PIX_FMT_YUYV);
  EXPECT_EQ(next().image->pixels.size(), 64u * 48u);
}

TEST_F(V4l2CameraTest, ASizeThatTheDeviceDoesNotGiveIsRefusedWithThoseItGives) {
  config_.width = 1280;
  config_.height = 720;
  EXPECT_THAT(error_of_opening(),
              AllOf(HasSubstr("/dev/video7: gives no images of 1280 x 720"), HasSubstr("64 x 48")));
  config_.width = config_.height = 0;
  model_ = {640, 480, 500, 500, 320, 240, Distortion::kNone, {}};
  EXPECT_THAT(error_of_opening(), HasSubstr("gives no images of 640 x 480")) << "as calibrated";
}

TEST_F(V4l2CameraTest, RawBayerImagesAreReferredToLibcamera) {
  camera_.offers = {{V4L2_PIX_FMT_SRGGB10P, {64, 48}, 30, 30}};
  EXPECT_THAT(error_of_opening(), AllOf(HasSubstr("pRAA"), HasSubstr("libcamera:")));
}

TEST_F(V4l2CameraTest, ANodeThatGivesNoImagesIsRefused) {
  camera_.capabilities = 0x04800000;  // metadata
  EXPECT_THAT(error_of_opening(), HasSubstr("without images (metadata"));
}

TEST_F(V4l2CameraTest, AStampAtTheEndOfAFrameIsPutBackByHalfTheExposureTheDeviceSays) {
  config_.exposure = ExposureMode::kAsIs;
  config_.latency_s = 0.001;
  open();
  const CameraFrame frame = next();  // ends now, by the simulated camera; exposes 8 ms
  const Duration error = frame.exposed_at - (clock_.now() - std::chrono::milliseconds(5));
  EXPECT_LE(abs(error), kStampRounding);
}

TEST_F(V4l2CameraTest, AStampAtTheStartOfExposureIsPutForwardAndLatencyDoesNotMatter) {
  camera_.stamp_flags |= V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  camera_.stamp_offset = -std::chrono::milliseconds(12);
  config_.exposure = ExposureMode::kAsIs;
  config_.latency_s = 0.5;
  config_.time_shift = std::chrono::milliseconds(1);
  open();
  const CameraFrame frame = next();
  const Duration error = frame.exposed_at - (clock_.now() - std::chrono::milliseconds(12 - 4 - 1));
  EXPECT_LE(abs(error), kStampRounding);
}

TEST_F(V4l2CameraTest, TheDriverOfUsbCamerasIsNotBelievedThatItsStampIsTheStartOfExposure) {
  camera_.driver = "uvcvideo";
  camera_.stamp_flags |= V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  config_.exposure = ExposureMode::kAsIs;
  open();
  const CameraFrame frame = next();
  const Duration error = frame.exposed_at - (clock_.now() - std::chrono::milliseconds(4));
  EXPECT_LE(abs(error), kStampRounding);
  EXPECT_THAT(said(), HasSubstr("when an image begins to arrive"));
}

TEST_F(V4l2CameraTest, StampsOfAnotherClockGiveWayToTheTimeOfArrival) {
  camera_.stamp_offset = std::chrono::hours(24);
  config_.exposure = ExposureMode::kAsIs;
  open();
  for (int i = 0; i < 3; ++i) {
    const CameraFrame frame = next();
    EXPECT_EQ(frame.exposed_at, clock_.now() - std::chrono::milliseconds(4));
  }
  EXPECT_THAT(said(), HasSubstr("the driver uses another clock"));
}

TEST_F(V4l2CameraTest, StampsFollowAnExposureThatTheDeviceRules) {
  camera_.knobs[V4L2_CID_EXPOSURE_AUTO] = {
      "Auto Exposure", 0, 3, V4L2_EXPOSURE_APERTURE_PRIORITY, V4L2_CTRL_TYPE_MENU, 1, {1, 3}};
  config_.exposure = ExposureMode::kAsIs;
  open();
  (void)next();
  camera_.knobs[V4L2_CID_EXPOSURE_ABSOLUTE].value = 120;
  CameraFrame frame;
  for (int i = 0; i < 70; ++i) frame = next();  // more than a second
  EXPECT_LE(abs(frame.exposed_at - (clock_.now() - std::chrono::milliseconds(6))), kStampRounding);
}

TEST_F(V4l2CameraTest, ImagesThatTheDeviceLeftOutAreCounted) {
  open();
  const std::uint32_t first = number_of(next());
  camera_.skipped = {first + 1, first + 2, first + 4};
  EXPECT_EQ(next().lost_before, 2u);
  EXPECT_EQ(next().lost_before, 1u);
  EXPECT_EQ(next().lost_before, 0u);
  EXPECT_THAT(said(), HasSubstr("2 not received"));
}

TEST_F(V4l2CameraTest, NumbersThatWrapAreNoLoss) {
  open();
  const std::uint32_t first = number_of(next());
  source_.reset();
  camera_.first_sequence = 0u - first - 40;  // wraps soon after it was measured
  open();
  for (int i = 0; i < 30; ++i) EXPECT_EQ(next().lost_before, 0u);
}

TEST_F(V4l2CameraTest, DamagedAndHalfImagesAreLeftOutAndCounted) {
  open();
  const std::uint32_t first = number_of(next());
  camera_.damaged = {first + 1};
  camera_.shortened = {first + 2};
  camera_.repeated_stamps = {first + 4};
  const CameraFrame third = next();
  EXPECT_EQ(number_of(third), first + 3);
  EXPECT_EQ(third.lost_before, 2u);
  const CameraFrame fifth = next();
  EXPECT_EQ(number_of(fifth), first + 5);
  EXPECT_GT(fifth.exposed_at, third.exposed_at);
  EXPECT_THAT(said(), HasSubstr("1 damaged in transfer"));
}

TEST_F(V4l2CameraTest, AJpegWithoutAnEndIsLeftOut) {
  cv::Mat picture(48, 64, CV_8UC1);
  cv::randu(picture, 0, 255);
  cv::imencode(".jpg", picture, camera_.jpeg);
  const auto whole = camera_.jpeg;
  camera_.offers = {{V4L2_PIX_FMT_MJPEG, {64, 48}, 30, 30}};
  open();
  EXPECT_EQ(next().lost_before, 0u);
  camera_.jpeg.resize(whole.size() / 2);
  camera_.stops_at = camera_.image + 3;
  EXPECT_FALSE(source_->next({})) << "half images, then none: lost";
  EXPECT_EQ(source_->next({}).error().code, ErrorCode::kClosed);
}

TEST_F(V4l2CameraTest, ADeviceThatFallsSilentIsLost) {
  open();
  (void)next();
  camera_.stops_at = camera_.image;
  const Instant began = clock_.now();
  const auto lost = source_->next({});
  ASSERT_FALSE(lost);
  EXPECT_THAT(lost.error().text(), HasSubstr("/dev/video7: gave no image for 1.0 s"));
  EXPECT_LT(clock_.now() - began, std::chrono::milliseconds(1300));
}

TEST_F(V4l2CameraTest, ADeviceThatWaitsForItsTriggerMayBeSilent) {
  camera_.knobs[0x00980fff] = {"Trigger Mode", 0, 1, 0};
  config_.trigger = "on";
  open();
  EXPECT_EQ(camera_.knobs[0x00980fff].value, 1);
  (void)next();
  clock_.advance(std::chrono::minutes(10));
  const std::uint32_t before = camera_.image;
  (void)next();
  EXPECT_GE(camera_.image, before);
}

TEST_F(V4l2CameraTest, ADeviceThatIsUnpluggedIsLostAndItsMemoryGivenBack) {
  open();
  (void)next();
  EXPECT_EQ(camera_.mapped, 4);
  camera_.unplugged_at = camera_.image;
  const auto lost = source_->next({});
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kClosed);
  source_.reset();
  EXPECT_EQ(camera_.mapped, 0);
}

TEST_F(V4l2CameraTest, AFewFailuresAreLivedThroughManyAreNot) {
  open();
  (void)next();
  camera_.dqbuf_failures = 3;
  camera_.qbuf_failures = 2;
  for (int i = 0; i < 10; ++i) (void)next();
  camera_.dqbuf_failures = 100;
  EXPECT_FALSE(source_->next({}));
}

TEST_F(V4l2CameraTest, AStopIsSeenWhileNothingComes) {
  open();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(source_->next(stop.get_token()).value());
}

TEST_F(V4l2CameraTest, NothingIsAllocatedForAnImageAfterTheFirstFew) {
  open();
  for (int i = 0; i < 8; ++i) (void)next();
  std::size_t allocated = 1;
  {
    const AllocationCounter counter;
    for (int i = 0; i < 50; ++i) (void)source_->next({});
    allocated = counter.count();
  }
  EXPECT_EQ(allocated, 0u);
}

}  // namespace
}  // namespace fiducap::v4l2
