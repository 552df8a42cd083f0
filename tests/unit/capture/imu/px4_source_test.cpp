// PX4's bridge over the middleware itself, on loopback.
#include <fiducap_dds/px4.h>
#include <fiducap_dds/ros_sensors.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "capture/imu/imu_source.hpp"
#include "capture/ros/ros_source.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

/// Real time, for sources that wait on the middleware.
class SteadyClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const override {
    return Instant{std::chrono::steady_clock::now().time_since_epoch()};
  }
  [[nodiscard]] bool wait_until(Instant, std::stop_token) const override { return false; }
};

class ImuTopicTest : public testing::Test {
 protected:
  void SetUp() override {
    dds::NetworkConfig network;
    network.domain = 45;
    auto participant = dds::Participant::open(network);
    ASSERT_TRUE(participant) << participant.error().text();
    participant_ = std::move(*participant);
  }
  Expected<std::unique_ptr<SensorSource>> open() {
    return open_imu_source(
        config_,
        {clock_, [this] { return Expected<std::shared_ptr<dds::Participant>>(participant_); }});
  }
  /// Writes until the reader, which has to be found first, has got one.
  template <typename Message>
  std::optional<ImuSample> first_of(SensorSource& source, const dds::TopicName& topic,
                                    Message& message) {
    auto writer = dds::Writer::make(*participant_, topic, {.reliable = false});
    EXPECT_TRUE(writer) << writer.error().text();
    std::stop_source stop;
    std::jthread sender([&](std::stop_token own) {
      for (int i = 0; i < 500 && !own.stop_requested(); ++i) {
        writer->write(&message);
        std::this_thread::sleep_for(10ms);
      }
      stop.request_stop();
    });
    const auto sample = source.next(stop.get_token());
    if (!sample || !*sample) return std::nullopt;
    return std::get<ImuSample>(**sample);
  }

  ImuSourceConfig config_;
  SteadyClock clock_;
  std::shared_ptr<dds::Participant> participant_;
};

TEST_F(ImuTopicTest, Px4IsTurnedToForwardLeftUp) {
  config_.type = ImuSourceType::kPx4;
  auto source = open();
  ASSERT_TRUE(source) << source.error().text();
  px4_msgs_msg_dds__SensorCombined_ message{};
  message.timestamp = static_cast<std::uint64_t>(dds::utc_now_ns() / 1000);
  for (int i = 0; i < 3; ++i) {
    message.gyro_rad[i] = static_cast<float>(i + 1);
    message.accelerometer_m_s2[i] = static_cast<float>(10 * (i + 1));
  }
  const auto sample = first_of(
      **source, {"rt/fmu/out/sensor_combined", &px4_msgs_msg_dds__SensorCombined__desc, {}},
      message);
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->w_WB_B, Eigen::Vector3d(1, -2, -3));
  EXPECT_EQ(sample->f_B, Eigen::Vector3d(10, -20, -30));
  EXPECT_LT(clock_.now() - sample->sampled_at, 5s) << "UTC of this machine is its stamp";
}

TEST_F(ImuTopicTest, Px4OfANewerVersionIsHeardToo) {
  config_.type = ImuSourceType::kPx4;
  auto source = open();
  ASSERT_TRUE(source) << source.error().text();
  px4_msgs_msg_dds__SensorCombined_ message{};
  message.timestamp = static_cast<std::uint64_t>(dds::utc_now_ns() / 1000);
  EXPECT_TRUE(first_of(
      **source, {"rt/fmu/out/sensor_combined_v1", &px4_msgs_msg_dds__SensorCombined__desc, {}},
      message));
}

TEST_F(ImuTopicTest, AnImuOfRos2AloneIsASource) {
  config_.type = ImuSourceType::kRos;
  config_.ros.topic = "/camera/imu";
  const std::vector<std::string> camera{"camera"};
  config_.axes = *axes_from(camera);
  auto source = open();
  ASSERT_TRUE(source) << source.error().text();
  sensor_msgs_msg_dds__Imu_ message{};
  const std::int64_t utc_ns = dds::utc_now_ns();
  message.header.stamp.sec = static_cast<std::int32_t>(utc_ns / 1'000'000'000);
  message.header.frame_id = const_cast<char*>("imu");
  message.linear_acceleration = {0.5, -9.8, 0.25};
  const auto sample =
      first_of(**source, {"rt/camera/imu", &sensor_msgs_msg_dds__Imu__desc, {}}, message);
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->f_B, Eigen::Vector3d(0.25, -0.5, 9.8)) << "forward, left, up";
}

}  // namespace
}  // namespace fiducap
