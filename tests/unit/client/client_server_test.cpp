// The server and the client library in one program, over real loopback sockets. The I/O thread is a
// real one, the server's clock is moved by the test, and every wait ends as soon as what it waits
// for is there.
#include <gtest/gtest.h>
#include <fiducap/client.hpp>

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <cmath>
#include <functional>
#include <future>
#include <mutex>
#include <thread>

#include "base/pose.hpp"
#include "unit/client/test_server.hpp"

namespace fiducap {
namespace {

/// Subscribes by hand and then neither reads nor renews.
class ClientThatNeverReads {
 public:
  explicit ClientThatNeverReads(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in server{};
    server.sin_family = AF_INET;
    server.sin_port = htons(port);
    server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd_, reinterpret_cast<sockaddr*>(&server), sizeof(server)), 0);
    std::array<std::uint8_t, 150> question{0x0d, 'F',  'D', 'C',
                                           '1',  0x12, 142, 1};  // Subscribe, 142 bytes:
    question[8] = 0x09;                                          // token
    question[17] = 0x3a;                                         // padding,
    question[18] = 130;                                          // 130 bytes
    question[19] = 1;
    EXPECT_EQ(::send(fd_, question.data(), question.size(), 0), 150);
    std::array<std::uint8_t, 64> challenge{};
    EXPECT_GT(::recv(fd_, challenge.data(), challenge.size(), 0), 16);
    EXPECT_EQ(challenge[7], 0x09);
    std::copy_n(challenge.begin() + 8, 8, question.begin() + 9);
    EXPECT_EQ(::send(fd_, question.data(), question.size(), 0), 150);
  }
  ~ClientThatNeverReads() { ::close(fd_); }
  ClientThatNeverReads(const ClientThatNeverReads&) = delete;
  ClientThatNeverReads& operator=(const ClientThatNeverReads&) = delete;

 private:
  int fd_;
};

TEST_F(ClientServerTest, FramesArriveAsTheyWereSent) {
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  scene_->bodies[1].valid = false;
  scene_->bodies[1].state = BodyState::kLost;
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
  EXPECT_EQ(frame.at_utc_ns - frame.at_server_ns, scene_->utc_offset.count());
  EXPECT_EQ(frame.rate_hz, 100.0);
  EXPECT_GT(frame.received_ns, 0);
  ASSERT_EQ(frame.bodies.size(), 2u);
  const Body& drone = frame.bodies[0];
  const BodyPose& sent = scene_->bodies[0];
  EXPECT_EQ(drone.name, "drone");
  EXPECT_EQ(drone.tracking, Tracking::kTracking);
  EXPECT_TRUE(drone.valid);
  EXPECT_EQ(drone.position_m,
            (std::array<double, 3>{sent.X_WP.p.x(), sent.X_WP.p.y(), sent.X_WP.p.z()}));
  EXPECT_EQ(drone.orientation_wxyz, (std::array<double, 4>{sent.X_WP.q.w(), sent.X_WP.q.x(),
                                                           sent.X_WP.q.y(), sent.X_WP.q.z()}));
  EXPECT_EQ(drone.velocity_m_s, (std::array<double, 3>{0.5, -0.25, 0.125}));
  constexpr double kFloat = 1e-6;  // sigmas travel as 32-bit floats
  EXPECT_NEAR(drone.position_sigma_m, 0.01, kFloat);
  EXPECT_DOUBLE_EQ(drone.age_s, 0.02);
  EXPECT_EQ(frame.bodies[1].name, "arm");
  EXPECT_EQ(frame.bodies[1].tracking, Tracking::kLost);
  EXPECT_FALSE(frame.bodies[1].valid);
  EXPECT_TRUE(std::isnan(frame.bodies[1].position_m[0]));
}

TEST_F(ClientServerTest, TheServerListsItsClientsUntilTheyLeave) {
  TestServer server(*scene_);
  {
    const Client client(options_for(server.port()));
    Frame frame;
    ASSERT_TRUE(receives_frame(client, server, frame));
    const auto clients = server.clients();
    ASSERT_EQ(clients.size(), 1u);
    EXPECT_EQ(clients[0].protocol, "native");
    EXPECT_EQ(clients[0].peer.rfind("127.0.0.1:", 0), 0u) << clients[0].peer;
    EXPECT_EQ(clients[0].detail.rfind("test, z-up m", 0), 0u) << clients[0].detail;
    EXPECT_GT(clients[0].frames_sent, 0u);
    EXPECT_EQ(clients[0].frames_dropped, 0u);
  }
  EXPECT_TRUE(wait_until([&] { return server.clients().empty(); }))
      << "the client did not say good-bye";
}

TEST_F(ClientServerTest, CountsFramesThatNeverCame) {
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
  const auto lost_before = client.statistics().lost;
  scene_->number += 41;  // as if 41 frames had been dropped on the way
  ASSERT_TRUE(receives_frame(client, server, frame));
  EXPECT_EQ(client.statistics().lost - lost_before, 41u);
}

TEST_F(ClientServerTest, ComesBackAfterARestartOfTheServer) {
  auto server = std::make_unique<TestServer>(*scene_);
  const std::uint16_t port = server->port();
  Client client(options_for(port));
  std::mutex mutex;
  std::vector<bool> connections;
  client.on_connection([&](bool connected) {
    const std::lock_guard lock(mutex);
    connections.push_back(connected);
  });
  scene_->number = 5000;
  Frame frame;
  ASSERT_TRUE(receives_frame(client, *server, frame));
  server.reset();
  ASSERT_TRUE(wait_until([&] { return !client.statistics().connected; }));
  EXPECT_NE(client.statistics().problem, "");
  EXPECT_TRUE(client.latest(frame)) << "the last frame stays readable";
  EXPECT_FALSE(client.wait_for_frame(frame.number, std::chrono::milliseconds(1)));

  auto renamed = make_scene_frame({"other", "arm"}, 1);
  server = std::make_unique<TestServer>(*renamed, port);
  const auto restarted = std::chrono::steady_clock::now();
  scene_ = renamed;
  ASSERT_TRUE(publish_until(*server, *scene_, [&] { return client.statistics().reconnects == 1; }));
  const auto took = std::chrono::steady_clock::now() - restarted;
  RecordProperty("reconnect_ms", static_cast<int>(took / std::chrono::milliseconds(1)));
  const std::uint64_t before_restart = frame.number;
  ASSERT_TRUE(receives_frame(client, *server, frame));
  EXPECT_LT(frame.number, before_restart);
  EXPECT_TRUE(client.wait_for_frame(before_restart, std::chrono::milliseconds(0)))
      << "newer than all before";
  EXPECT_EQ(frame.bodies[0].name, "other");
  const std::lock_guard lock(mutex);
  EXPECT_EQ(connections, (std::vector<bool>{true, false, true}));
}

TEST_F(ClientServerTest, FindsAServerThatStartsLater) {
  std::uint16_t port = 0;
  { port = TestServer(*scene_).port(); }
  const Client client(options_for(port));
  Frame frame;
  EXPECT_FALSE(client.latest(frame));
  ASSERT_TRUE(wait_until([&] {
    return client.statistics().problem.find("fiducapd") != std::string::npos;
  })) << client.statistics().problem;
  TestServer server(*scene_, port);
  EXPECT_TRUE(receives_frame(client, server, frame));
  EXPECT_EQ(client.statistics().reconnects, 0u);
  EXPECT_EQ(client.statistics().problem, "");
}

TEST_F(ClientServerTest, SubscribesAgainWhenTheServerForgotIt) {
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
  server.clock().advance(std::chrono::minutes(5));  // lease and token are long over, for the server
  ++scene_->number;
  server.publish(std::make_shared<SceneFrame>(*scene_));
  EXPECT_TRUE(server.clients().empty());
  EXPECT_TRUE(receives_frame(client, server, frame));
}

TEST_F(ClientServerTest, ABigSceneArrivesWhole) {
  scene_ = make_scene_frame(names(100), 1);
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
  ASSERT_EQ(frame.bodies.size(), 100u);
  for (std::size_t i = 0; i < 100; ++i) {
    EXPECT_EQ(frame.bodies[i].id, static_cast<int>(i) + 1);
    EXPECT_EQ(frame.bodies[i].name, "body" + std::to_string(i));
    EXPECT_EQ(frame.bodies[i].position_m[0], 1.0 + static_cast<double>(i));
  }
}

TEST_F(ClientServerTest, NewNamesArriveWhileFramesFlow) {
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
  auto model = std::make_shared<SceneModel>(*scene_->model);
  model->generation = 2;
  model->bodies[0].name = "renamed";
  scene_->model = model;
  ASSERT_TRUE(publish_until(
      server, *scene_, [&] { return client.latest(frame) && frame.bodies[0].name == "renamed"; }));
  EXPECT_TRUE(client.statistics().connected);
}

TEST_F(ClientServerTest, TwoClientsReceiveTheSame) {
  TestServer server(*scene_);
  const Client one(options_for(server.port()));
  const Client two(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(
      publish_until(server, *scene_, [&] { return one.latest(frame) && two.latest(frame); }));
  EXPECT_EQ(server.clients().size(), 2u);
  Frame other;
  ASSERT_TRUE(wait_until(
      [&] { return one.latest(frame) && two.latest(other) && frame.number == other.number; }));
  EXPECT_EQ(frame.bodies[1].position_m, other.bodies[1].position_m);
}

TEST_F(ClientServerTest, OneClientTooManyIsToldWhy) {
  native::NativeConfig config;
  config.max_clients = 1;
  TestServer server(*scene_, 0, config);
  auto first = std::make_unique<Client>(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(receives_frame(*first, server, frame));
  const Client second(options_for(server.port()));
  ASSERT_TRUE(wait_until([&] {
    return second.statistics().problem.find("max_clients") != std::string::npos;
  })) << second.statistics().problem;
  first.reset();
  EXPECT_TRUE(receives_frame(second, server, frame)) << "a place is free now";
}

TEST_F(ClientServerTest, AClientThatNeverReadsDisturbsNobodyAndIsForgotten) {
  scene_ = make_scene_frame(names(100), 1);
  TestServer server(*scene_);
  const ClientThatNeverReads dead(server.port());
  ASSERT_TRUE(wait_until([&] { return server.clients().size() == 1; }));
  const Client client(options_for(server.port()));
  ASSERT_TRUE(publish_until(server, *scene_, [&] { return client.statistics().frames >= 200; }));
  EXPECT_EQ(server.clients().size(), 2u);
  server.clock().advance(std::chrono::milliseconds(2900));
  ASSERT_TRUE(publish_until(server, *scene_, [&] {
    server.clock().advance(std::chrono::milliseconds(1));
    return server.clients().size() == 1;
  }));
  EXPECT_EQ(server.clients()[0].detail.rfind("test", 0), 0u);
}

TEST_F(ClientServerTest, CallsBackForEveryFrame) {
  TestServer server(*scene_);
  Client client(options_for(server.port()));
  std::atomic<int> calls{0};
  std::atomic<std::uint64_t> last{0};
  client.on_frame([&](const Frame& frame) {
    EXPECT_GT(frame.number, last.load());
    last = frame.number;
    ++calls;
  });
  ASSERT_TRUE(publish_until(server, *scene_, [&] { return calls.load() >= 20; }));
  client.on_frame(nullptr);
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
}

TEST_F(ClientServerTest, TellsANewListenerThatTheConnectionIsThere) {
  TestServer server(*scene_);
  Client client(options_for(server.port()));
  ASSERT_TRUE(wait_until([&] { return client.statistics().connected; }));
  std::promise<bool> told;
  client.on_connection([&](bool connected) { told.set_value(connected); });
  auto answer = told.get_future();
  ASSERT_EQ(answer.wait_for(kPatience), std::future_status::ready);
  EXPECT_TRUE(answer.get());
  client.on_connection(nullptr);
}

TEST_F(ClientServerTest, WaitsForTheNextFrame) {
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  EXPECT_FALSE(client.wait_for_frame(0, std::chrono::milliseconds(1)));
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
  ASSERT_TRUE(client.wait_for_frame(0, kPatience));
  ASSERT_TRUE(client.latest(frame));
  EXPECT_FALSE(client.wait_for_frame(scene_->number, std::chrono::milliseconds(1)));
  auto waiting = std::async(std::launch::async,
                            [&] { return client.wait_for_frame(scene_->number, kPatience); });
  auto next = std::make_shared<SceneFrame>(*scene_);
  ++next->number;
  server.publish(next);
  EXPECT_TRUE(waiting.get());
}

TEST_F(ClientServerTest, MeasuresLatencyOnlyOnTheSameTimeLine) {
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  scene_->at = instant_from_ns(5'000'000'000);
  ++scene_->number;
  Frame frame;
  ASSERT_TRUE(wait_until([&] {  // frames of a recording: another time line
    ++scene_->number;
    server.publish(std::make_shared<SceneFrame>(*scene_));
    return client.latest(frame);
  }));
  if (monotonic_ns() > 20'000'000'000) {
    EXPECT_TRUE(std::isnan(client.statistics().latency_p50_s));
  }
  ASSERT_TRUE(publish_until(server, *scene_,
                            [&] { return std::isfinite(client.statistics().latency_p50_s); }));
  EXPECT_GT(client.statistics().latency_p50_s, 0.0);
  EXPECT_LT(client.statistics().latency_p50_s, to_seconds(kPatience));
  EXPECT_GE(client.statistics().latency_p99_s, client.statistics().latency_p50_s);
  EXPECT_GT(client.statistics().rate_hz, 0.0);
}

TEST_F(ClientServerTest, ResolvesAHostName) {
  TestServer server(*scene_);
  auto options = options_for(server.port());
  options.server = "localhost";
  const Client client(options);
  Frame frame;
  EXPECT_TRUE(receives_frame(client, server, frame)) << client.statistics().problem;
}

TEST(ClientTest, SaysThatAHostNameIsUnknown) {
  ClientOptions options;
  options.server = "no such host";
  const Client client(options);
  EXPECT_TRUE(wait_until([&] {
    return client.statistics().problem.find("no such host") != std::string::npos;
  })) << client.statistics().problem;
  EXPECT_FALSE(client.statistics().connected);
}

TEST_F(ClientServerTest, AClientWithoutServerEndsAtOnce) {
  std::uint16_t port = 0;
  { port = TestServer(*scene_).port(); }
  const auto start = std::chrono::steady_clock::now();
  {
    auto options = options_for(port);
    options.reconnect_s = 60;
    const Client client(options);
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, kPatience);
}

}  // namespace
}  // namespace fiducap
