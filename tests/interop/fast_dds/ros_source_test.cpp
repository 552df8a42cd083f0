// A camera and an IMU driver on Fast DDS, read as a source.
#include "capture/ros/ros_source.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <map>
#include <thread>
#include <utility>

#include "peer_process.hpp"
#include "support/real_clock.hpp"

namespace fiducap::dds {
namespace {

class RosSourceFromFastDds : public testing::Test {
 protected:
  void SetUp() override {
    NetworkConfig network;
    network.domain = 47;
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

TEST_F(RosSourceFromFastDds, GivesImagesAndImuSamplesInOrderWithTheDriversLens) {
  PeerProcess driver({"write", "47", "127.0.0.1", "127.0.0.1", "6", "/cam0"});
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
  std::map<bool, Instant> last;  // by whether it is an image
  const Instant end = clock_.now() + std::chrono::seconds(3);
  std::stop_source stop;
  while (clock_.now() < end) {
    auto sample = (*source)->next(stop.get_token());
    ASSERT_TRUE(sample) << sample.error().text();
    ASSERT_TRUE(*sample);
    const Instant at = time_of(**sample);
    EXPECT_LE(at, clock_.now());
    EXPECT_GE(at, clock_.now() - std::chrono::seconds(1));
    const auto* frame = std::get_if<CameraFrame>(&**sample);
    const auto [before, first] = last.try_emplace(frame != nullptr, at);
    EXPECT_TRUE(first || at > std::exchange(before->second, at));
    if (frame != nullptr) {
      ++images;
      EXPECT_EQ(frame->image->width, 640);
      EXPECT_EQ(frame->image->pixels.front(), frame->image->pixels.back())
          << "one image, not parts of two";
    } else {
      ++readings;
      EXPECT_EQ(std::get<ImuSample>(**sample).f_B.z(), 9.81);
    }
  }
  EXPECT_GE(images, 40);     // 20 Hz for 3 s, less the time of discovery
  EXPECT_GE(readings, 400);  // 200 Hz
}

TEST_F(RosSourceFromFastDds, MissingLensIsAnErrorWithTheTopic) {
  config_.camera_info_wait_s = 0.2;
  std::vector<CameraMount> cameras(1);
  const auto lens = wait_for_lenses(*participant_, config_, cameras, clock_);
  ASSERT_FALSE(lens);
  EXPECT_THAT(lens.error().text(), testing::HasSubstr("/cam0/camera_info"));
}

TEST_F(RosSourceFromFastDds, StopsSoonWithoutSamples) {
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
