// Over real sockets on loopback: the autopilot is a UDP socket.
#include "base/log.hpp"
#include "streaming/mavlink/mavlink.hpp"

#include <gmock/gmock.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/udp.hpp>
#include <chrono>

#include "streaming/mavlink/vehicle_link.hpp"
#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::mavlink {
namespace {

using boost::asio::ip::udp;
using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

std::shared_ptr<SceneFrame> frame_of(std::uint64_t number, const char* name = "drone") {
  return make_scene_frame({name, "rover"}, number);
}

class MavlinkServerTest : public testing::Test {
 protected:
  MavlinkServerTest() {
    VehicleConfig vehicle;
    vehicle.body = "drone";
    vehicle.port = autopilot_.local_endpoint().port();
    config_.address = "127.0.0.1";
    config_.vehicles = {vehicle};
    for (auto* socket : {&autopilot_, &stranger_}) socket->non_blocking(true);
  }
  void start() {
    auto server = serve({io_, frame_of(1)->model, clock_}, config_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  /// All datagrams that have arrived; on loopback they arrive at once.
  static std::vector<std::byte> received(udp::socket& socket) {
    std::vector<std::byte> all;
    std::array<std::byte, 2048> buffer{};
    boost::system::error_code error;
    for (;;) {
      const auto n = socket.receive(boost::asio::buffer(buffer), 0, error);
      if (error || n == 0) return all;
      all.insert(all.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(n));
    }
  }
  void send(udp::socket& from, const std::vector<std::byte>& bytes) {
    from.send_to(boost::asio::buffer(bytes),
                 {boost::asio::ip::address_v4::loopback(), server_->port()});
    io_.restart();
    io_.run_for(20ms);
  }

  boost::asio::io_context io_;
  FakeClock clock_;
  udp::socket autopilot_{io_, udp::endpoint(boost::asio::ip::address_v4::loopback(), 0)};
  udp::socket stranger_{io_, udp::endpoint(boost::asio::ip::address_v4::loopback(), 0)};
  MavlinkConfig config_;
  std::unique_ptr<Streamer> server_;
};

TEST_F(MavlinkServerTest, AnswersConfiguredVehiclesOnly) {
  start();
  std::vector<std::byte> request;
  encode_timesync({1, 1, 0}, {0, 42}, request);
  send(stranger_, request);
  EXPECT_THAT(received(stranger_), IsEmpty());
  send(autopilot_, request);
  EXPECT_THAT(received(autopilot_), Not(IsEmpty()));
}

TEST_F(MavlinkServerTest, SendsTheBodyOfTheVehicleAlsoWhenRenamed) {
  start();
  server_->publish(frame_of(2));
  const auto bytes = received(autopilot_);
  std::span<const std::byte> in(bytes);
  const auto odometry = next_frame(in);
  ASSERT_TRUE(odometry);
  EXPECT_EQ(odometry->message, static_cast<std::uint32_t>(MessageId::kOdometry));
  EXPECT_EQ(odometry->system, 1);
  EXPECT_EQ(odometry->component, kVisualInertialOdometry);
  server_->publish(frame_of(10, "falcon"));
  EXPECT_THAT(received(autopilot_), Not(IsEmpty()));
  std::vector<ClientStatus> clients;
  server_->append_clients(clients);
  ASSERT_THAT(clients, SizeIs(1));
  EXPECT_EQ(clients[0].protocol, "mavlink");
  EXPECT_EQ(clients[0].frames_sent, 2u);
  EXPECT_THAT(clients[0].detail, HasSubstr("frd 40 Hz"));
}

TEST_F(MavlinkServerTest, CountsTheReturnOfALostBody) {
  start();
  std::uint8_t reset_counter = 0;
  std::uint64_t number = 1;
  for (const bool valid : {true, false, true}) {
    const auto frame = frame_of(number += 100);
    frame->bodies[0].valid = valid;
    server_->publish(frame);
    const auto bytes = received(autopilot_);
    std::span<const std::byte> in(bytes);
    while (const auto message = next_frame(in)) {
      if (message->message == static_cast<std::uint32_t>(MessageId::kOdometry))
        reset_counter = static_cast<std::uint8_t>(message->payload[230]);
    }
  }
  EXPECT_EQ(reset_counter, 1);
}

TEST_F(MavlinkServerTest, AllocatesNothingPerFrameAfterWarmUp) {
  config_.vehicles[0].message = PoseMessage::kBoth;
  start();
  for (std::uint64_t i = 2; i < 102; ++i) server_->publish(frame_of(i));
  const auto frame = frame_of(1000);
  log::flush(10s);  // its thread allocates, too
  const AllocationCounter counter;
  for (int i = 0; i < 200; ++i) {
    frame->at += 10ms;
    server_->publish(frame);
  }
  EXPECT_EQ(counter.count(), 0u);
}

TEST(MavlinkConfig, ReportsEachInvalidValue) {
  MavlinkConfig config;
  VehicleConfig vehicle;
  vehicle.body = "drone";
  config.vehicles = {vehicle};
  EXPECT_THAT(config.check(), IsEmpty());
  config.vehicles = {vehicle, vehicle};
  ASSERT_THAT(config.check(), SizeIs(1)) << "one address for two vehicles";
  EXPECT_EQ(config.check()[0].path, "streaming.mavlink.vehicles.1.port");
  vehicle = {};  // without a body
  vehicle.address = "px4.local";
  vehicle.port = 0;
  vehicle.rate_hz = 0;
  vehicle.system_id = 256;
  vehicle.component_id = 0;
  config.vehicles = {vehicle};
  EXPECT_THAT(config.check(), SizeIs(6));
}

}  // namespace
}  // namespace fiducap::mavlink
