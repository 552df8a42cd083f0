#include "capture/camera_device.hpp"

#include <gmock/gmock.h>

#include <linux/videodev2.h>
#include <opencv2/imgcodecs.hpp>

#include "support/allocation_counter.hpp"
#include "support/new_log.hpp"
#include "support/results.hpp"
#include "support/simulated_camera.hpp"

namespace fiducap::v4l2 {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

// Kernel stamps are of whole microseconds.
constexpr Duration kStampRounding = std::chrono::microseconds(1);

class V4l2CameraTest : public testing::Test {
 protected:
  V4l2CameraTest() {
    camera_.offers = {{V4L2_PIX_FMT_YUYV, {64, 48}, 30, 30}, {V4L2_PIX_FMT_GREY, {64, 48}, 60, 60}};
    camera_.knobs[V4L2_CID_EXPOSURE_ABSOLUTE] = {"Exposure Time, Absolute", 1, 5000, 80};
  }
  Expected<std::unique_ptr<SensorSource>> try_open() {
    return open_v4l2_camera(camera_.open(), "/dev/video7", config_, model_, clock_);
  }
  void open() { source_ = value_of(try_open()); }
  CameraFrame next() { return std::get<CameraFrame>(value_of(source_->next({})).value()); }
  /// Error of an image's stamp that should be this long ago.
  Duration stamp_error(Duration ago) {
    const Instant stamp = next().exposed_at;
    return abs(stamp - (clock_.now() - ago));
  }
  std::uint32_t number_of(const CameraFrame& frame) const { return frame.image->pixels[0]; }

  FakeClock clock_{instant_from_ns(100'000'000'000)};
  SimulatedCamera camera_{clock_};
  CameraDeviceConfig config_;
  CameraModel model_;
  std::unique_ptr<SensorSource> source_;
  NewLog log_;
};

class OpenV4l2CameraTest : public V4l2CameraTest {
 protected:
  OpenV4l2CameraTest() { open(); }
};

TEST_F(OpenV4l2CameraTest, UsesTheFastestFormatAndNamesTheOthers) {
  EXPECT_EQ(camera_.mode.code, V4L2_PIX_FMT_GREY);
  EXPECT_THAT(log_.text(),
              HasSubstr("/dev/video7 (Simulated): GREY 64 x 48 at 60.0 Hz measured; also "
                        "offers YUYV (30.0 Hz nominal)"));
  EXPECT_EQ(camera_.streams, 1) << "a lower nominal rate is not tried";
}

TEST_F(V4l2CameraTest, UsesTheMeasuredRateAndPrefersGray) {
  camera_.offers = {{V4L2_PIX_FMT_GREY, {64, 48}, 60, 12}, {V4L2_PIX_FMT_YUYV, {64, 48}, 30, 30}};
  open();
  EXPECT_EQ(camera_.mode.code, V4L2_PIX_FMT_YUYV);
  EXPECT_THAT(log_.text(), HasSubstr("YUYV 64 x 48 at 30.0 Hz measured; also offers GREY (12.0 Hz "
                                     "measured)"));
  source_.reset();
  camera_.offers = {{V4L2_PIX_FMT_MJPEG, {64, 48}, 30, 30},
                    {V4L2_PIX_FMT_YUYV, {64, 48}, 30, 30},
                    {V4L2_PIX_FMT_GREY, {64, 48}, 29.97, 29.97}};
  open();
  EXPECT_EQ(camera_.mode.code, V4L2_PIX_FMT_GREY);
}

TEST_F(V4l2CameraTest, UsesAConfiguredSlowerFormat) {
  config_.format = "YUYV";
  open();
  EXPECT_EQ(camera_.mode.code, V4L2_PIX_FMT_YUYV);
  EXPECT_EQ(next().image->pixels.size(), 64u * 48u);
}

TEST_F(V4l2CameraTest, RefusesUnavailableSizesAndFormats) {
  config_.width = 1280;
  config_.height = 720;
  EXPECT_THAT(error_of(try_open()),
              AllOf(HasSubstr("/dev/video7: gives no images of 1280 x 720"), HasSubstr("64 x 48")));
  config_.width = config_.height = 0;
  model_ = {640, 480, 500, 500, 320, 240};
  EXPECT_THAT(error_of(try_open()), HasSubstr("gives no images of 640 x 480")) << "as calibrated";
  model_ = {};
  camera_.offers = {{V4L2_PIX_FMT_SRGGB10P, {64, 48}, 30, 30}};
  EXPECT_THAT(error_of(try_open()), AllOf(HasSubstr("pRAA"), HasSubstr("libcamera:")));
  camera_.capabilities = 0x04800000;  // metadata
  EXPECT_THAT(error_of(try_open()), HasSubstr("without images (metadata"));
}

TEST_F(V4l2CameraTest, StampsTheMiddleOfTheExposure) {
  const struct {
    const char* what;
    const char* driver;
    bool marks_start;
    Duration offset;
    double latency_s;
    Duration shift, ago, tolerance;
    const char* logged;
  } kCases[] = {
      {"the end of the frame", "simulated", false, 0ms, 0.001, 0ms, 5ms, kStampRounding, ""},
      {"the start of exposure", "simulated", true, -12ms, 0.5, 1ms, 7ms, kStampRounding, ""},
      {"the start of exposure, by USB", "uvcvideo", true, 0ms, 0, 0ms, 4ms, kStampRounding,
       "when an image begins to arrive"},
      {"another clock", "simulated", false, 24h, 0, 0ms, 4ms, 0ms, "the driver uses another clock"},
  };
  config_.exposure = ExposureMode::kAsIs;  // 8 ms; an image ends now
  for (const auto& c : kCases) {
    SCOPED_TRACE(c.what);
    camera_.driver = c.driver;
    camera_.stamp_flags = 0x00002000u | (c.marks_start ? V4L2_BUF_FLAG_TSTAMP_SRC_SOE : 0u);
    camera_.stamp_offset = c.offset;
    config_.latency_s = c.latency_s > 0 ? c.latency_s : CameraDeviceConfig{}.latency_s;
    config_.time_shift = c.shift;
    source_.reset();
    log_ = {};
    open();
    for (int i = 0; i < 3; ++i) EXPECT_LE(stamp_error(c.ago), c.tolerance);
    EXPECT_THAT(log_.text(), HasSubstr(c.logged));
  }
}

TEST_F(V4l2CameraTest, FollowsTheAutomaticExposureInItsStamps) {
  camera_.knobs[V4L2_CID_EXPOSURE_AUTO] = {
      "Auto Exposure", 0, 3, V4L2_EXPOSURE_APERTURE_PRIORITY, V4L2_CTRL_TYPE_MENU, 1, {1, 3}};
  config_.exposure = ExposureMode::kAsIs;
  open();
  (void)next();
  camera_.knobs[V4L2_CID_EXPOSURE_ABSOLUTE].value = 120;
  for (int i = 0; i < 69; ++i) (void)next();  // more than a second
  EXPECT_LE(stamp_error(6ms), kStampRounding);
}

TEST_F(OpenV4l2CameraTest, CountsImagesThatTheDeviceSkipped) {
  const std::uint32_t first = number_of(next());
  camera_.skipped = {first + 1, first + 2, first + 4};
  EXPECT_EQ(next().lost_before, 2u);
  EXPECT_EQ(next().lost_before, 1u);
  EXPECT_EQ(next().lost_before, 0u);
  EXPECT_THAT(log_.text(), HasSubstr("2 not received"));
}

TEST_F(OpenV4l2CameraTest, CountsNoLossWhenNumbersWrap) {
  const std::uint32_t first = number_of(next());
  source_.reset();
  camera_.first_sequence = 0u - first - 40;  // wraps soon after it was measured
  open();
  for (int i = 0; i < 30; ++i) EXPECT_EQ(next().lost_before, 0u);
}

TEST_F(OpenV4l2CameraTest, DropsAndCountsDamagedAndPartialImages) {
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
  EXPECT_THAT(log_.text(), HasSubstr("1 damaged in transfer"));
}

TEST_F(V4l2CameraTest, DropsJpegImagesWithoutTheirEnd) {
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

TEST_F(OpenV4l2CameraTest, IsLostWhenNoImageComesForASecond) {
  (void)next();
  camera_.stops_at = camera_.image;
  const Instant began = clock_.now();
  EXPECT_THAT(error_of(source_->next({})), HasSubstr("/dev/video7: gave no image for 1.0 s"));
  EXPECT_LT(clock_.now() - began, 1300ms);
}

TEST_F(V4l2CameraTest, WaitsForAnExternalTrigger) {
  camera_.knobs[0x00980fff] = {"Trigger Mode", 0, 1, 0};
  config_.trigger = "on";
  open();
  EXPECT_EQ(camera_.knobs[0x00980fff].value, 1);
  (void)next();
  clock_.advance(10min);
  const std::uint32_t before = camera_.image;
  (void)next();
  EXPECT_GE(camera_.image, before);
}

TEST_F(OpenV4l2CameraTest, IsLostAndUnmappedWhenUnplugged) {
  (void)next();
  EXPECT_EQ(camera_.mapped, 4);
  camera_.unplugged_at = camera_.image;
  const auto lost = source_->next({});
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kClosed);
  source_.reset();
  EXPECT_EQ(camera_.mapped, 0);
}

TEST_F(OpenV4l2CameraTest, ToleratesAFewFailures) {
  (void)next();
  camera_.dqbuf_failures = 3;
  camera_.qbuf_failures = 2;
  for (int i = 0; i < 10; ++i) (void)next();
  camera_.dqbuf_failures = 100;
  EXPECT_FALSE(source_->next({}));
}

TEST_F(OpenV4l2CameraTest, StopsWhenRequested) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(source_->next(stop.get_token()).value());
}

TEST_F(OpenV4l2CameraTest, AllocatesNothingPerImageAfterWarmUp) {
  for (int i = 0; i < 8; ++i) (void)next();
  const AllocationCounter counter;
  for (int i = 0; i < 50; ++i) (void)source_->next({});
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap::v4l2
