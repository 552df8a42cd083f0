// A camera and an IMU driver on Fast DDS, read as a source.
#include "capture/ros/ros_source.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "peer_process.hpp"

namespace fiducap::dds {
namespace {

constexpr int kDomain = 47;

/// Monotonic, as the server's own.
class RealClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const override {
    return Instant{
        std::chrono::duration_cast<Duration>(std::chrono::steady_clock::now().time_since_epoch())};
  }
  [[nodiscard]] bool wait_until(Instant at, std::stop_token) const override {
    std::this_thread::sleep_for(at - now());
    return true;
  }
};

class RosSourceFromFastDds : public testing::Test {
 protected:
  void SetUp() override {
    NetworkConfig network;
    network.domain = kDomain;
    auto participant = Participant::open(network);
    ASSERT_TRUE(participant) << participant.error().text();
    participant_ = *participant;
    config_.images = {"/cam0/image_raw"};
    config_.imu = "/imu/data";
  }
  RealClock clock_;
  std::shared_ptr<Participant> participant_;
  RosSourceConfig config_;
};

TEST_F(RosSourceFromFastDds, GivesImagesAndReadingsInOrderWithTheLensOfTheDriver) {
  PeerProcess driver({"write", std::to_string(kDomain), "127.0.0.1", "127.0.0.1", "6", "/cam0"});
  std::vector<CameraMount> cameras(1);
  const auto lens = wait_for_lenses(*participant_, config_, cameras, clock_);
  ASSERT_TRUE(lens) << lens.error().text();
  EXPECT_EQ(cameras[0].model.width, 640);
  EXPECT_EQ(cameras[0].model.fu, 458.0);
  EXPECT_EQ(cameras[0].model.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(cameras[0].model.coefficients[1], 0.07);

  auto source = open_ros_source(participant_, config_, cameras, clock_);
  ASSERT_TRUE(source) << source.error().text();
  int images = 0;
  int readings = 0;
  std::optional<Instant> last_image;
  std::optional<Instant> last_reading;
  const Instant end = clock_.now() + std::chrono::seconds(3);
  std::stop_source stop;
  while (clock_.now() < end) {
    auto sample = (*source)->next(stop.get_token());
    ASSERT_TRUE(sample) << sample.error().text();
    ASSERT_TRUE(*sample);
    const Instant at = time_of(**sample);
    EXPECT_LE(at, clock_.now());
    EXPECT_GE(at, clock_.now() - std::chrono::seconds(1));
    if (const auto* frame = std::get_if<CameraFrame>(&**sample)) {
      ++images;
      EXPECT_EQ(frame->image->width, 640);
      EXPECT_EQ(frame->image->pixels.front(), frame->image->pixels.back())
          << "one image, not parts of two";
      if (last_image) {
        EXPECT_GT(at, *last_image);
      }
      last_image = at;
    } else {
      ++readings;
      EXPECT_EQ(std::get<ImuSample>(**sample).f_B.z(), 9.81);
      if (last_reading) {
        EXPECT_GT(at, *last_reading);
      }
      last_reading = at;
    }
  }
  EXPECT_GE(images, 40);     // 20 Hz for 3 s, less what finding each other takes
  EXPECT_GE(readings, 400);  // 200 Hz
}

TEST_F(RosSourceFromFastDds, ALensThatNobodyTellsIsAnErrorThatNamesTheTopic) {
  config_.camera_info_wait_s = 0.2;
  std::vector<CameraMount> cameras(1);
  const auto lens = wait_for_lenses(*participant_, config_, cameras, clock_);
  ASSERT_FALSE(lens);
  EXPECT_THAT(lens.error().text(), testing::HasSubstr("/cam0/camera_info"));
}

TEST_F(RosSourceFromFastDds, StopsWithinMomentsWhenNothingComes) {
  std::vector<CameraMount> cameras(1);
  auto source = open_ros_source(participant_, config_, cameras, clock_);
  ASSERT_TRUE(source);
  std::stop_source stop;
  std::jthread stopper([&stop] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    stop.request_stop();
  });
  const auto sample = (*source)->next(stop.get_token());
  ASSERT_TRUE(sample);
  EXPECT_FALSE(*sample);
}

}  // namespace
}  // namespace fiducap::dds
