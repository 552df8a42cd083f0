// Over real sockets on loopback: an autopilot that is a UDP socket.
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
using testing::SizeIs;

class MavlinkServerTest : public testing::Test {
 protected:
  MavlinkServerTest() : autopilot_(io_, udp::endpoint(boost::asio::ip::address_v4::loopback(), 0)) {
    VehicleConfig vehicle;
    vehicle.body = "drone";
    vehicle.port = autopilot_.local_endpoint().port();
    config_.address = "127.0.0.1";
    config_.vehicles = {vehicle};
    autopilot_.non_blocking(true);
  }
  void start() {
    auto server = start_mavlink_server(io_, config_, frame_->model, clock_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  void publish() {
    frame_ = make_scene_frame({"drone", "rover"}, frame_->number + 1);
    server_->publish(frame_);
  }
  /// What has come to the autopilot; datagrams on loopback are there at once.
  std::vector<std::byte> received() {
    std::vector<std::byte> all;
    std::array<std::byte, 2048> buffer{};
    boost::system::error_code error;
    udp::endpoint from;
    for (std::size_t n = 0;
         (n = autopilot_.receive_from(boost::asio::buffer(buffer), from, 0, error)) > 0 &&
         !error;) {
      all.insert(all.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(n));
    }
    return all;
  }
  void say(udp::socket& from, const std::vector<std::byte>& bytes) {
    from.send_to(boost::asio::buffer(bytes),
                 {boost::asio::ip::address_v4::loopback(), server_->port()});
    io_.restart();
    io_.run_for(20ms);
  }

  boost::asio::io_context io_;
  FakeClock clock_;
  udp::socket autopilot_;
  MavlinkConfig config_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"drone", "rover"});
  std::unique_ptr<Streamer> server_;
};

TEST_F(MavlinkServerTest, SendsTheBodyOfTheVehicle) {
  start();
  publish();
  const auto bytes = received();
  std::span<const std::byte> in(bytes);
  const auto odometry = next_frame(in);
  ASSERT_TRUE(odometry);
  EXPECT_EQ(odometry->message, static_cast<std::uint32_t>(MessageId::kOdometry));
  EXPECT_EQ(odometry->system, 1);
  EXPECT_EQ(odometry->component, kVisualInertialOdometry);
}

TEST_F(MavlinkServerTest, AnswersConfiguredVehiclesOnly) {
  start();
  std::vector<std::byte> question;
  encode_timesync({1, 1, 0}, {0, 42}, question);
  udp::socket stranger(io_, udp::endpoint(boost::asio::ip::address_v4::loopback(), 0));
  stranger.non_blocking(true);
  say(stranger, question);
  std::array<std::byte, 64> buffer{};
  boost::system::error_code error;
  stranger.receive(boost::asio::buffer(buffer), 0, error);
  EXPECT_EQ(error, boost::asio::error::would_block);
  say(autopilot_, question);
  EXPECT_THAT(received(), SizeIs(testing::Gt(0u)));
}

TEST_F(MavlinkServerTest, FollowsARenamedBodyAndReportsListeners) {
  start();
  publish();
  received();
  auto renamed = make_scene_frame({"falcon", "rover"}, 10);
  server_->publish(renamed);
  EXPECT_FALSE(received().empty());
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
  for (const bool valid : {true, false, true}) {
    frame_ = make_scene_frame({"drone", "rover"}, frame_->number + 100);
    frame_->bodies[0].valid = valid;
    server_->publish(frame_);
    const auto bytes = received();
    std::span<const std::byte> in(bytes);
    while (const auto message = next_frame(in)) {
      if (message->message != static_cast<std::uint32_t>(MessageId::kOdometry)) continue;
      reset_counter = static_cast<std::uint8_t>(message->payload[230]);
    }
  }
  EXPECT_EQ(reset_counter, 1);
}

TEST_F(MavlinkServerTest, AllocatesNothingPerFrameAfterWarmUp) {
  start();
  for (int i = 0; i < 100; ++i) publish();
  auto frame = make_scene_frame({"drone", "rover"}, 1000);
  log::flush(std::chrono::seconds(10));  // its thread allocates, too
  const AllocationCounter counter;
  for (int i = 0; i < 200; ++i) {
    frame->at += 10ms;
    server_->publish(frame);
  }
  EXPECT_EQ(counter.count(), 0u);
}

TEST_F(MavlinkServerTest, APortInUseIsAnErrorThatNamesTheRemedy) {
  config_.port = autopilot_.local_endpoint().port();
  const auto server = start_mavlink_server(io_, config_, frame_->model, clock_);
  ASSERT_FALSE(server);
  EXPECT_THAT(server.error().text(), HasSubstr("streaming.mavlink.port"));
}

}  // namespace
}  // namespace fiducap::mavlink
