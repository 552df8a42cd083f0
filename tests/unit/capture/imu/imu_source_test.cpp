// Both ends over pseudo terminals and loopback sockets.
#include "capture/imu/imu_source.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <chrono>
#include <thread>

#include "capture/imu/byte_link.hpp"
#include "support/hex.hpp"
#include "unit/capture/imu/mavlink_bytes.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// Real time, for sources that wait on real descriptors.
class MachineClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const override {
    return Instant{std::chrono::steady_clock::now().time_since_epoch()};
  }
  [[nodiscard]] bool wait_until(Instant, std::stop_token) const override { return false; }
};

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
  void write(const std::string& text) const {
    write(std::as_bytes(std::span(text.data(), text.size())));
  }
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
  Expected<std::unique_ptr<SensorSource>> open() { return open_imu_source(config_, {clock_, {}}); }

  ImuSourceConfig config_;
  MachineClock clock_;
};

TEST_F(ImuSourceTest, ASerialLineIsReadTurnedAndScaled) {
  const PseudoTerminal device;
  config_.line.device = device.name();
  config_.line.baud = 250'000;  // not one of the usual ones
  config_.units = {GyroUnit::kDegrees, AccelUnit::kG};
  const std::vector<std::string> axes{"y", "-x", "z"};
  config_.axes = *axes_from(axes);
  auto source = open();
  ASSERT_TRUE(source) << source.error().text();
  device.write(kFirst);
  const auto sample = (*source)->next({});
  ASSERT_TRUE(sample && *sample);
  const auto& imu = std::get<ImuSample>(**sample);
  EXPECT_NEAR(imu.f_B.x(), -0.2 * 9.80665, 1e-12);
  EXPECT_NEAR(imu.f_B.y(), -0.1 * 9.80665, 1e-12);
  EXPECT_NEAR(imu.w_WB_B.z(), 0.03 * 0.017453292519943295, 1e-12);
  EXPECT_LT(clock_.now() - imu.sampled_at, 2s);
}

TEST_F(ImuSourceTest, AnUnpluggedLineIsLostAndOpensAgain) {
  auto device = std::make_unique<PseudoTerminal>();
  config_.line.device = device->name();
  auto source = open();
  ASSERT_TRUE(source) << source.error().text();
  device->write(kFirst);
  ASSERT_TRUE((*source)->next({}));
  device->unplug();
  const auto lost = (*source)->next({});
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kClosed);
  EXPECT_THAT(lost.error().text(), HasSubstr("unplugged"));
  source = fail(ErrorCode::kClosed, "");  // lets go of it
  const PseudoTerminal again;
  config_.line.device = again.name();
  auto reopened = open();
  ASSERT_TRUE(reopened) << reopened.error().text();
  again.write(kFirst);
  EXPECT_TRUE((*reopened)->next({}));
}

TEST_F(ImuSourceTest, ALineIsForOneAlone) {
  const PseudoTerminal device;
  config_.line.device = device.name();
  const auto first = open();
  ASSERT_TRUE(first) << first.error().text();
  const auto second = open();
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().text(), HasSubstr("another program uses the serial device"));
}

TEST_F(ImuSourceTest, WhatIsNoSerialDeviceIsSaid) {
  config_.line.device = "/dev/ttyThatIsNotThere";
  EXPECT_EQ(open().error().code, ErrorCode::kNotFound);
  config_.line.device = "/dev/null";
  EXPECT_THAT(open().error().text(), HasSubstr("is no serial device"));
}

TEST_F(ImuSourceTest, DatagramsOfTheProtocolAreRead) {
  LinkConfig receiving;
  receiving.address = "127.0.0.1";
  auto reserved = ByteLink::open(receiving);  // a port that is free
  ASSERT_TRUE(reserved);
  const std::uint16_t port = reserved->port();
  { const auto closed = std::move(*reserved); }
  config_.line.address = "127.0.0.1";
  config_.line.port = port;
  auto source = open();
  ASSERT_TRUE(source) << source.error().text();
  receiving.peer = "127.0.0.1";
  auto device = ByteLink::open(receiving);
  ASSERT_TRUE(device);
  device->write(std::as_bytes(std::span(kFirst.data(), kFirst.size())), {0x7f000001, port});
  EXPECT_TRUE((*source)->next({}));
  const auto taken = open();
  ASSERT_FALSE(taken);
  EXPECT_THAT(taken.error().text(), HasSubstr("another program uses the UDP port"));
}

TEST_F(ImuSourceTest, AnAutopilotIsReadAndAskedBySerialLine) {
  const PseudoTerminal device;
  config_.type = ImuSourceType::kMavlink;
  config_.mavlink.link.device = device.name();
  auto source = open();
  ASSERT_TRUE(source) << source.error().text();
  device.write(from_hex(mavlink::golden::kHeartbeatOfPx4));
  device.write(from_hex(mavlink::golden::kHighres));
  const auto sample = (*source)->next({});
  ASSERT_TRUE(sample && *sample);
  EXPECT_EQ(std::get<ImuSample>(**sample).f_B, Eigen::Vector3d(0.5, 0.25, 9.75));
  EXPECT_GE(device.read_some(), 21u + 28u) << "a heartbeat, a clock question";
}

TEST(ByteLink, AnAddressThatHasProvenNothingGetsThreeTimesItsBytesOfIp) {
  LinkConfig config;
  config.address = "127.0.0.1";
  auto link = ByteLink::open(config);
  ASSERT_TRUE(link);
  config.peer = "127.0.0.1:" + std::to_string(link->port());
  auto other = ByteLink::open(config);
  ASSERT_TRUE(other);
  const LinkPeer to{0x7f000001, other->port()};
  constexpr std::size_t kHeaders = 28;
  const std::vector<std::byte> datagram(21);
  const auto drawn = [&] {
    std::size_t bytes = 0;
    for (auto piece = other->read(100ms); piece && !piece->bytes.empty();
         piece = other->read(100ms))
      bytes += piece->bytes.size() + kHeaders;
    return bytes;
  };
  for (int i = 0; i < 20; ++i) link->write(datagram, to);
  EXPECT_EQ(drawn(), 0u) << "it has not spoken";
  other->write(datagram, {0x7f000001, link->port()});
  ASSERT_TRUE(link->read(1s));
  for (int i = 0; i < 20; ++i) link->write(datagram, to);
  EXPECT_EQ(drawn(), 3 * (datagram.size() + kHeaders));
  link->write(datagram, to, true);
  EXPECT_EQ(drawn(), datagram.size() + kHeaders) << "proven";
}

TEST_F(ImuSourceTest, AStopEndsTheWaiting) {
  const PseudoTerminal device;
  config_.line.device = device.name();
  auto source = open();
  ASSERT_TRUE(source) << source.error().text();
  std::stop_source stop;
  std::jthread stopper([&] {
    std::this_thread::sleep_for(20ms);
    stop.request_stop();
  });
  const auto end = (*source)->next(stop.get_token());
  ASSERT_TRUE(end);
  EXPECT_EQ(*end, std::nullopt);
}

}  // namespace
}  // namespace fiducap
