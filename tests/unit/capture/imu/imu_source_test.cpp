// Both ends over pseudo terminals, loopback sockets and the middleware.
#include "capture/imu/imu_source.hpp"

#include <fcntl.h>
#include <fiducap_dds/px4.h>
#include <fiducap_dds/ros_sensors.h>
#include <gmock/gmock.h>
#include <pty.h>
#include <unistd.h>

#include <chrono>
#include <thread>

#include "capture/imu/byte_link.hpp"
#include "capture/ros/ros_source.hpp"
#include "support/hex.hpp"
#include "support/real_clock.hpp"
#include "support/results.hpp"
#include "unit/capture/imu/mavlink_bytes.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// The device's end of a serial line.
class PseudoTerminal final {
 public:
  PseudoTerminal() {
    std::array<char, 128> name{};
    int slave = -1;
    EXPECT_EQ(::openpty(&master_, &slave, name.data(), nullptr, nullptr), 0);
    ::close(slave);
    name_ = name.data();
  }
  ~PseudoTerminal() { unplug(); }
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  void write(std::span<const std::byte> bytes) const {
    EXPECT_EQ(::write(master_, bytes.data(), bytes.size()), std::ssize(bytes));
  }
  void write(const std::string& text) const { write(bytes_of(text)); }
  /// What the other end has written.
  [[nodiscard]] std::size_t read_some() const {
    std::array<std::byte, 512> bytes{};
    const ssize_t size = ::read(master_, bytes.data(), bytes.size());
    return size > 0 ? static_cast<std::size_t>(size) : 0;
  }
  void unplug() {
    if (master_ >= 0) ::close(master_);
    master_ = -1;
  }
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  int master_{-1};
  std::string name_;
};

const std::string kFirst = "\nIMU,1000000,0.01,-0.02,0.03,0.1,-0.2,9.81*4F\n";

class ImuSourceTest : public testing::Test {
 protected:
  Expected<std::unique_ptr<SensorSource>> try_open() {
    return open_imu_source(config_, {clock_, {}});
  }
  std::unique_ptr<SensorSource> open() { return value_of(try_open()); }
  std::unique_ptr<SensorSource> open(const PseudoTerminal& device) {
    config_.line.device = device.name();
    return open();
  }
  static ImuSample read(SensorSource& source) {
    return std::get<ImuSample>(value_of(source.next({})).value());
  }

  PseudoTerminal device_;
  ImuSourceConfig config_;
  SteadyClock clock_;
};

TEST_F(ImuSourceTest, ReadsRotatesAndScalesASerialLine) {
  config_.line.baud = 250'000;  // not a standard rate
  config_.units = {GyroUnit::kDegrees, AccelUnit::kG};
  config_.axes = *axes_from(std::vector<std::string>{"y", "-x", "z"});
  const auto source = open(device_);
  device_.write(kFirst);
  const ImuSample imu = read(*source);
  EXPECT_NEAR(imu.f_B.x(), -0.2 * 9.80665, 1e-12);
  EXPECT_NEAR(imu.f_B.y(), -0.1 * 9.80665, 1e-12);
  EXPECT_NEAR(imu.w_WB_B.z(), 0.03 * 0.017453292519943295, 1e-12);
  EXPECT_LT(clock_.now() - imu.sampled_at, 2s);
}

TEST_F(ImuSourceTest, IsLostWhenUnpluggedAndOpensAgain) {
  auto source = open(device_);
  device_.write(kFirst);
  (void)read(*source);
  device_.unplug();
  const auto lost = source->next({});
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kClosed);
  EXPECT_THAT(lost.error().text(), HasSubstr("unplugged"));
  source.reset();
  const PseudoTerminal again;
  source = open(again);
  again.write(kFirst);
  EXPECT_TRUE(source->next({}));
}

TEST_F(ImuSourceTest, RefusesALineInUseAndOtherFiles) {
  const auto first = open(device_);
  EXPECT_THAT(error_of(try_open()), HasSubstr("another program uses the serial device"));
  config_.line.device = "/dev/ttyThatIsNotThere";
  EXPECT_EQ(try_open().error().code, ErrorCode::kNotFound);
  config_.line.device = "/dev/null";
  EXPECT_THAT(error_of(try_open()), HasSubstr("is no serial device"));
}

TEST_F(ImuSourceTest, ReadsDatagrams) {
  LinkConfig receiving;
  receiving.address = "127.0.0.1";
  const std::uint16_t port = value_of(ByteLink::open(receiving)).port();  // a free one
  config_.line.address = "127.0.0.1";
  config_.line.port = port;
  const auto source = open();
  receiving.peer = "127.0.0.1";
  auto device = value_of(ByteLink::open(receiving));
  device.write(bytes_of(kFirst), {0x7f000001, port});
  EXPECT_TRUE(source->next({}));
  EXPECT_THAT(error_of(try_open()), HasSubstr("the UDP port is used by this process itself"));
}

TEST_F(ImuSourceTest, ReadsAndConfiguresAnAutopilotBySerialLine) {
  config_.type = ImuSourceType::kMavlink;
  config_.mavlink.link.device = device_.name();
  const auto source = open();
  device_.write(from_hex(mavlink::golden::kHeartbeatOfPx4));
  device_.write(from_hex(mavlink::golden::kHighres));
  EXPECT_EQ(read(*source).f_B, Eigen::Vector3d(0.5, 0.25, 9.75));
  EXPECT_GE(device_.read_some(), 21u + 28u) << "a heartbeat, a clock question";
}

TEST(ByteLink, SendsAnUnprovenAddressThreeTimesItsBytes) {
  LinkConfig config;
  config.address = "127.0.0.1";
  auto link = value_of(ByteLink::open(config));
  config.peer = "127.0.0.1:" + std::to_string(link.port());
  auto other = value_of(ByteLink::open(config));
  const net::Peer to{0x7f000001, other.port()};
  constexpr std::size_t kHeaders = 28;
  const std::vector<std::byte> datagram(21);
  const auto received = [&] {
    std::size_t bytes = 0;
    for (auto piece = other.read(100ms); piece && !piece->bytes.empty(); piece = other.read(100ms))
      bytes += piece->bytes.size() + kHeaders;
    return bytes;
  };
  for (int i = 0; i < 20; ++i) link.write(datagram, to);
  EXPECT_EQ(received(), 0u) << "it has sent nothing";
  other.write(datagram, {0x7f000001, link.port()});
  ASSERT_TRUE(link.read(1s));
  for (int i = 0; i < 20; ++i) link.write(datagram, to);
  EXPECT_EQ(received(), 3 * (datagram.size() + kHeaders));
  link.write(datagram, to, true);
  EXPECT_EQ(received(), datagram.size() + kHeaders) << "proven";
}

TEST_F(ImuSourceTest, StopsWaitingWhenRequested) {
  const auto source = open(device_);
  std::stop_source stop;
  std::jthread stopper([&] {
    std::this_thread::sleep_for(20ms);
    stop.request_stop();
  });
  EXPECT_EQ(value_of(source->next(stop.get_token())), std::nullopt);
}

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

TEST_F(ImuTopicTest, JoinsTwoTopicsOfRos2) {
  config_.type = ImuSourceType::kRos;
  config_.ros = {.topic = "/camera/gyro/sample", .accel = "/camera/accel/sample"};
  const auto source = open();
  const dds::Qos best_effort{.reliable = false};
  auto gyro = value_of(dds::Writer::make(
      *participant_, {"rt/camera/gyro/sample", &sensor_msgs_msg_dds__Imu__desc, {}}, best_effort));
  auto accel = value_of(dds::Writer::make(
      *participant_, {"rt/camera/accel/sample", &sensor_msgs_msg_dds__Imu__desc, {}}, best_effort));
  std::stop_source stop;
  std::jthread sender([&](std::stop_token own) {
    for (int i = 0; i < 500 && !own.stop_requested(); ++i) {
      sensor_msgs_msg_dds__Imu_ message{};
      const std::int64_t now_ns = dds::utc_now_ns();
      message.header.stamp.sec = static_cast<std::int32_t>(now_ns / 1'000'000'000);
      message.header.stamp.nanosec = static_cast<std::uint32_t>(now_ns % 1'000'000'000);
      message.header.frame_id = const_cast<char*>("imu");
      message.angular_velocity = {1, 2, 3};
      gyro.write(&message);
      message.angular_velocity = {};
      message.linear_acceleration = {4, 5, 6};
      accel.write(&message);
      std::this_thread::sleep_for(10ms);
    }
    stop.request_stop();
  });
  const auto sample = std::get<ImuSample>(value_of(source->next(stop.get_token())).value());
  EXPECT_EQ(sample.w_WB_B, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(sample.f_B.isApprox(Eigen::Vector3d(4, 5, 6)));
}

}  // namespace
}  // namespace fiducap
