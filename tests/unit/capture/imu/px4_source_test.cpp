// PX4's bridge over the middleware itself, on loopback.
#include <fiducap_dds/px4.h>
#include <fiducap_dds/ros_sensors.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "capture/imu/imu_source.hpp"
#include "capture/ros/ros_source.hpp"
#include "support/real_clock.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

class ImuTopicTest : public testing::Test {
 protected:
  void SetUp() override {
    dds::NetworkConfig network;
    network.domain = 45;
    participant_ = value_of(dds::Participant::open(network));
  }
  std::unique_ptr<SensorSource> open() {
    return value_of(open_imu_source(
        config_,
        {clock_, [this] { return Expected<std::shared_ptr<dds::Participant>>(participant_); }}));
  }
  /// Writes until the reader is discovered and has received one.
  template <typename Message>
  ImuSample first_of(SensorSource& source, const dds::TopicName& topic, Message& message) {
    auto writer = value_of(dds::Writer::make(*participant_, topic, {.reliable = false}));
    std::stop_source stop;
    std::jthread sender([&](std::stop_token own) {
      for (int i = 0; i < 500 && !own.stop_requested(); ++i) {
        writer.write(&message);
        std::this_thread::sleep_for(10ms);
      }
      stop.request_stop();
    });
    return std::get<ImuSample>(value_of(source.next(stop.get_token())).value());
  }

  ImuSourceConfig config_;
  SteadyClock clock_;
  std::shared_ptr<dds::Participant> participant_;
};

TEST_F(ImuTopicTest, RotatesReadingsOfPx4ToForwardLeftUp) {
  config_.type = ImuSourceType::kPx4;
  for (const char* topic : {"rt/fmu/out/sensor_combined", "rt/fmu/out/sensor_combined_v1"}) {
    SCOPED_TRACE(topic);  // of two versions
    const auto source = open();
    px4_msgs_msg_dds__SensorCombined_ message{};
    message.timestamp = static_cast<std::uint64_t>(dds::utc_now_ns() / 1000);
    for (int i = 0; i < 3; ++i) {
      message.gyro_rad[i] = static_cast<float>(i + 1);
      message.accelerometer_m_s2[i] = static_cast<float>(10 * (i + 1));
    }
    const auto sample =
        first_of(*source, {topic, &px4_msgs_msg_dds__SensorCombined__desc, {}}, message);
    EXPECT_EQ(sample.w_WB_B, Eigen::Vector3d(1, -2, -3));
    EXPECT_EQ(sample.f_B, Eigen::Vector3d(10, -20, -30));
    EXPECT_LT(clock_.now() - sample.sampled_at, 5s) << "its stamp is UTC of this machine";
  }
}

TEST_F(ImuTopicTest, ReadsAnImuOfRos2) {
  config_.type = ImuSourceType::kRos;
  config_.ros.topic = "/camera/imu";
  config_.axes = *axes_from(std::vector<std::string>{"camera"});
  const auto source = open();
  sensor_msgs_msg_dds__Imu_ message{};
  message.header.stamp.sec = static_cast<std::int32_t>(dds::utc_now_ns() / 1'000'000'000);
  message.header.frame_id = const_cast<char*>("imu");
  message.linear_acceleration = {0.5, -9.8, 0.25};
  const auto sample =
      first_of(*source, {"rt/camera/imu", &sensor_msgs_msg_dds__Imu__desc, {}}, message);
  EXPECT_EQ(sample.f_B, Eigen::Vector3d(0.25, -0.5, 9.8)) << "forward, left, up";
}

}  // namespace
}  // namespace fiducap
