// The server and the client library in one program, over real loopback sockets. The server's clock
// is moved by the test, and every wait ends as soon as its condition holds.
#include <gmock/gmock.h>

#include <atomic>
#include <boost/asio/ip/udp.hpp>
#include <cmath>
#include <mutex>

#include "unit/client/test_server.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::StartsWith;

/// Subscribes by hand and then neither reads nor renews.
boost::asio::ip::udp::socket client_that_never_reads(boost::asio::io_context& io,
                                                     std::uint16_t port) {
  using boost::asio::ip::udp;
  const auto here = boost::asio::ip::address_v4::loopback();
  udp::socket socket(io, udp::endpoint(here, 0));
  socket.connect({here, port});
  // Subscribe, 142 bytes: token, padding of 130 bytes.
  std::array<std::uint8_t, 150> request{0x0d, 'F', 'D', 'C', '1', 0x12, 142, 1, 0x09};
  request[17] = 0x3a;
  request[18] = 130;
  request[19] = 1;
  EXPECT_EQ(socket.send(boost::asio::buffer(request)), 150u);
  std::array<std::uint8_t, 64> challenge{};
  EXPECT_GT(socket.receive(boost::asio::buffer(challenge)), 16u);
  EXPECT_EQ(challenge[7], 0x09);
  std::copy_n(challenge.begin() + 8, 8, request.begin() + 9);
  EXPECT_EQ(socket.send(boost::asio::buffer(request)), 150u);
  return socket;
}

TEST_F(ClientServerTest, FramesArriveAsTheyWereSent) {
  scene_->bodies[1].valid = false;
  scene_->bodies[1].state = BodyState::kLost;
  connect();
  EXPECT_EQ(frame_.at_utc_ns - frame_.at_server_ns, scene_->utc_offset.count());
  EXPECT_EQ(frame_.rate_hz, 100.0);
  EXPECT_EQ(statistics().reconnects, 0u);
  EXPECT_GT(frame_.received_ns, 0);
  ASSERT_EQ(frame_.bodies.size(), 2u);
  const Body& drone = frame_.bodies[0];
  const auto& [q, p] = scene_->bodies[0].X_WP;
  EXPECT_EQ(drone.name, "drone");
  EXPECT_EQ(drone.tracking, Tracking::kTracking);
  EXPECT_TRUE(drone.valid);
  EXPECT_THAT(drone.position_m, ElementsAre(p.x(), p.y(), p.z()));
  EXPECT_THAT(drone.orientation_wxyz, ElementsAre(q.w(), q.x(), q.y(), q.z()));
  EXPECT_THAT(drone.velocity_m_s, ElementsAre(0.5, -0.25, 0.125));
  constexpr double kFloat = 1e-6;  // sigmas are 32-bit floats on the wire
  EXPECT_NEAR(drone.position_sigma_m, 0.01, kFloat);
  EXPECT_DOUBLE_EQ(drone.age_s, 0.02);
  const Body& arm = frame_.bodies[1];
  EXPECT_EQ(arm.name, "arm");
  EXPECT_EQ(arm.tracking, Tracking::kLost);
  EXPECT_FALSE(arm.valid);
  EXPECT_TRUE(std::isnan(arm.position_m[0]));
}

TEST_F(ClientServerTest, ServerListsItsClientsUntilTheyLeave) {
  connect();
  const auto clients = server_->clients();
  ASSERT_EQ(clients.size(), 1u);
  EXPECT_EQ(clients[0].protocol, "native");
  EXPECT_THAT(clients[0].peer, StartsWith("127.0.0.1:"));
  EXPECT_THAT(clients[0].detail, StartsWith("test, z-up m"));
  EXPECT_GT(clients[0].frames_sent, 0u);
  EXPECT_EQ(clients[0].frames_dropped, 0u);
  client_.reset();
  EXPECT_TRUE(wait_until([&] { return server_->clients().empty(); })) << "it did not unsubscribe";
}

TEST_F(ClientServerTest, ReconnectsToARestartedServer) {
  start();
  const std::uint16_t port = server_->port();
  std::mutex mutex;
  std::vector<bool> connections;
  client_ = std::make_unique<Client>(options());
  client_->on_connection([&](bool connected) {
    const std::lock_guard lock(mutex);
    connections.push_back(connected);
  });
  scene_->number = 5000;
  ASSERT_TRUE(receives(*client_));
  server_.reset();
  ASSERT_TRUE(wait_until([&] { return !statistics().connected; }));
  EXPECT_NE(statistics().problem, "");
  EXPECT_TRUE(client_->latest(frame_)) << "the last frame stays readable";
  const std::uint64_t before_restart = frame_.number;
  EXPECT_FALSE(client_->wait_for_frame(before_restart, std::chrono::milliseconds(1)));

  scene_ = make_scene_frame({"other", "arm"}, 1);
  start({}, port);
  const auto restarted_ns = monotonic_ns();
  ASSERT_TRUE(publish_until([&] { return statistics().reconnects == 1; }));
  RecordProperty("reconnect_ms", static_cast<int>((monotonic_ns() - restarted_ns) / 1'000'000));
  ASSERT_TRUE(receives(*client_));
  EXPECT_LT(frame_.number, before_restart);
  EXPECT_TRUE(client_->wait_for_frame(before_restart, std::chrono::milliseconds(0)))
      << "newer than all before";
  EXPECT_EQ(frame_.bodies[0].name, "other");
  client_->on_connection(nullptr);
  EXPECT_EQ(connections, (std::vector<bool>{true, false, true}));
}

TEST_F(ClientServerTest, ClientThatNeverReadsDisturbsNoOtherAndIsRemoved) {
  scene_ = make_scene_frame(numbered_names(100), 1);
  start();
  boost::asio::io_context io;
  const auto dead = client_that_never_reads(io, server_->port());
  ASSERT_TRUE(wait_until([&] { return server_->clients().size() == 1; }));
  connect();
  ASSERT_TRUE(publish_until([&] { return statistics().frames >= 200; }));
  EXPECT_EQ(server_->clients().size(), 2u);
  server_->clock().advance(std::chrono::milliseconds(2900));
  ASSERT_TRUE(publish_until([&] {
    server_->clock().advance(std::chrono::milliseconds(1));
    return server_->clients().size() == 1;
  }));
  EXPECT_THAT(server_->clients()[0].detail, StartsWith("test"));
}

TEST_F(ClientServerTest, CallsBackForEveryFrame) {
  start();
  client_ = std::make_unique<Client>(options());
  std::atomic<int> calls{0};
  std::atomic<std::uint64_t> last{0};
  client_->on_frame([&](const Frame& frame) {
    EXPECT_GT(frame.number, last.load());
    last = frame.number;
    ++calls;
  });
  ASSERT_TRUE(publish_until([&] { return calls.load() >= 20; }));
  client_->on_frame(nullptr);
  ASSERT_TRUE(receives(*client_));
}

TEST_F(ClientServerTest, NewListenerIsCalledWhenConnected) {
  connect();
  std::promise<bool> called;
  client_->on_connection([&](bool connected) { called.set_value(connected); });
  auto answer = called.get_future();
  ASSERT_EQ(answer.wait_for(kTimeout), std::future_status::ready);
  EXPECT_TRUE(answer.get());
  client_->on_connection(nullptr);
}

TEST_F(ClientServerTest, WaitsForTheNextFrame) {
  start();
  client_ = std::make_unique<Client>(options());
  EXPECT_FALSE(client_->wait_for_frame(0, std::chrono::milliseconds(1)));
  ASSERT_TRUE(receives(*client_));
  ASSERT_TRUE(client_->wait_for_frame(0, kTimeout));
  EXPECT_FALSE(client_->wait_for_frame(scene_->number, std::chrono::milliseconds(1)));
  auto waiting = std::async(std::launch::async,
                            [&] { return client_->wait_for_frame(scene_->number, kTimeout); });
  auto next = std::make_shared<SceneFrame>(*scene_);
  ++next->number;
  server_->publish(next);
  EXPECT_TRUE(waiting.get());
}

TEST_F(ClientServerTest, LatencyIsUnknownOnAnotherTimeLine) {
  start();
  client_ = std::make_unique<Client>(options());
  scene_->at = instant_from_ns(5'000'000'000);  // as in a recording
  ASSERT_TRUE(wait_until([&] {
    ++scene_->number;
    server_->publish(std::make_shared<SceneFrame>(*scene_));
    return client_->latest(frame_);
  }));
  if (monotonic_ns() > 20'000'000'000) {
    EXPECT_TRUE(std::isnan(statistics().latency_p50_s));
  }
  ASSERT_TRUE(publish_until([&] { return std::isfinite(statistics().latency_p50_s); }));
  EXPECT_GT(statistics().latency_p50_s, 0.0);
  EXPECT_LT(statistics().latency_p50_s, to_seconds(kTimeout));
  EXPECT_GE(statistics().latency_p99_s, statistics().latency_p50_s);
  EXPECT_GT(statistics().rate_hz, 0.0);
}

TEST_F(ClientServerTest, ResolvesHostNames) {
  connect([](ClientOptions& options) { options.server = "localhost"; });
  ClientOptions unknown;
  unknown.server = "no such host";
  const Client client(unknown);
  EXPECT_TRUE(wait_until([&] {
    return client.statistics().problem.find("no such host") != std::string::npos;
  })) << client.statistics().problem;
  EXPECT_FALSE(client.statistics().connected);
}

TEST_F(ClientServerTest, ClientWithoutAServerEndsAtOnce) {
  start();
  auto options = options_for(server_->port());
  server_.reset();
  options.reconnect_s = 60;
  const auto begin_ns = monotonic_ns();
  { const Client client(options); }
  EXPECT_LT(Duration{monotonic_ns() - begin_ns}, kTimeout);
}

}  // namespace
}  // namespace fiducap
