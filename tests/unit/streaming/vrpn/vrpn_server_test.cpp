#include "streaming/vrpn/vrpn_server.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <functional>
#include <random>

#include "strict_client.hpp"
#include "support/fake_clock.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vrpn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using std::chrono::milliseconds;

// A test that hangs has failed; nothing below waits this long otherwise.
constexpr auto kHang = std::chrono::seconds(20);

/// Server and clients on real loopback sockets, all in this thread.
class VrpnServerTest : public testing::Test {
 protected:
  ~VrpnServerTest() override {
    if (server_) server_->stop();
    io_.restart();
    io_.run();
  }

  void start(const std::vector<std::string>& bodies = {"arm", "drone"}) {
    names_ = bodies;
    config_.port = port_;
    auto server = start_vrpn_server(io_, config_, make_scene_frame(bodies)->model, clock_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    port_ = server_->port();
    ASSERT_GT(port_, 0);
  }
  std::shared_ptr<SceneFrame> frame() { return make_scene_frame(names_, ++number_); }
  void publish() { server_->publish(frame()); }

  void step() {
    io_.restart();
    io_.run_for(milliseconds(1));
    for (auto* client : clients_) client->pump();
  }
  [[nodiscard]] bool until(const std::function<bool()>& holds) {
    const auto end = std::chrono::steady_clock::now() + kHang;
    while (!holds()) {
      if (std::chrono::steady_clock::now() > end) return false;
      step();
    }
    return true;
  }
  void steps(int n) {
    for (int i = 0; i < n; ++i) step();
  }
  /// Time passes for the server only; its housekeeping runs every 100 ms of real time.
  void pass(Duration d) {
    clock_.advance(d);
    steps(150);
  }
  [[nodiscard]] std::vector<ClientStatus> status() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  VrpnConfig config_;
  std::uint16_t port_{0};
  std::vector<std::string> names_;
  std::uint64_t number_{0};
  std::unique_ptr<VrpnStreamer> server_;
  std::vector<StrictClient*> clients_;
};

TEST_F(VrpnServerTest, ServesADirectClientByTcp) {
  start();
  StrictClient client;
  client.connect(port_);
  clients_ = {&client};
  ASSERT_TRUE(until([&] { return client.ready(); }));
  EXPECT_THAT(client.bodies(), ElementsAre("arm", "drone"));
  publish();
  ASSERT_TRUE(until([&] { return client.reports.size() == 4; }));
  EXPECT_EQ(client.reports[0].sender, "arm");
  EXPECT_EQ(client.reports[0].type, "vrpn_Tracker Pos_Quat");
  EXPECT_EQ(client.reports[1].type, "vrpn_Tracker Velocity");
  EXPECT_EQ(client.reports[2].sender, "drone");
  EXPECT_FALSE(client.reports[0].udp);
  EXPECT_EQ(client.reports[2].values[0], 2.0);
  // 2023-11-14 22:13:25.010 UTC, the stamp of the frame; doubles hold it to less than a microsecond.
  EXPECT_NEAR(client.reports[3].utc_s, 1700000005.010, 1e-6);
  EXPECT_THAT(client.violations, IsEmpty());
}

TEST_F(VrpnServerTest, ServesARequestingClientByUdp) {
  start();
  StrictClient client;
  client.request(port_);
  clients_ = {&client};
  ASSERT_TRUE(until([&] { return client.ready(); }));
  EXPECT_THAT(status().at(0).peer, HasSubstr(" udp"));
  publish();
  publish();
  ASSERT_TRUE(until([&] { return client.reports.size() == 8; }));
  for (const auto& report : client.reports) EXPECT_TRUE(report.udp);
  EXPECT_THAT(client.violations, IsEmpty());
  EXPECT_EQ(status().at(0).frames_sent, 2u);
}

TEST_F(VrpnServerTest, EverythingByTcpWhenUdpIsOffOrNotOffered) {
  config_.udp_reports = false;
  start();
  StrictClient offering;
  StrictClient not_offering;
  offering.request(port_);
  not_offering.request(port_, 1, false);
  clients_ = {&offering, &not_offering};
  ASSERT_TRUE(until([&] { return offering.ready() && not_offering.ready(); }));
  publish();
  ASSERT_TRUE(until([&] { return offering.reports.size() == 4 && not_offering.reports.size() == 4; }));
  for (const auto& report : offering.reports) EXPECT_FALSE(report.udp);
  EXPECT_THAT(offering.violations, IsEmpty());
}

TEST_F(VrpnServerTest, BothCookieOrdersWorkInBothModes) {
  start();
  StrictClient a(StrictClient::CookieOrder::kAfterServer);
  StrictClient b(StrictClient::CookieOrder::kAfterServer);
  StrictClient c(StrictClient::CookieOrder::kFirst);
  a.connect(port_);
  b.request(port_);
  c.request(port_);
  clients_ = {&a, &b, &c};
  ASSERT_TRUE(until([&] { return a.ready() && b.ready() && c.ready(); }));
  for (const auto* client : clients_) EXPECT_THAT(client->violations, IsEmpty());
}

TEST_F(VrpnServerTest, AnswersPingsAndRequests) {
  start();
  StrictClient client;
  client.connect(port_);
  clients_ = {&client};
  ASSERT_TRUE(until([&] { return client.ready(); }));
  client.ask("drone", "vrpn_Base ping_message");
  client.ask("arm", "vrpn_Tracker Request_Tracker_To_Room");
  client.ask("arm", "vrpn_Tracker Request_Unit_To_Sensor");
  client.ask("arm", "vrpn_Tracker Request_Tracker_Workspace");
  ASSERT_TRUE(until([&] { return client.answers.size() == 3; }));
  EXPECT_THAT(client.pongs, ElementsAre("drone"));
  EXPECT_THAT(client.violations, IsEmpty());
}

TEST_F(VrpnServerTest, RepeatedRequestsMakeOneConnection) {
  start();
  StrictClient client;
  client.request(port_, 5);
  clients_ = {&client};
  ASSERT_TRUE(until([&] { return client.ready(); }));
  steps(20);
  EXPECT_EQ(client.extra_connections(), 0);
  EXPECT_EQ(status().size(), 1u);
}

TEST_F(VrpnServerTest, DescribesANewBodyBeforeItsFirstReport) {
  start({"arm"});
  StrictClient client;
  client.connect(port_);
  clients_ = {&client};
  ASSERT_TRUE(until([&] { return client.ready(); }));
  names_ = {"arm", "rover"};
  auto later = frame();
  auto model = std::make_shared<SceneModel>(*later->model);
  model->generation = 2;
  later->model = model;
  server_->publish(later);
  ASSERT_TRUE(until([&] { return client.reports.size() == 4; }));
  EXPECT_THAT(client.bodies(), ElementsAre("arm", "rover"));
  EXPECT_EQ(client.reports[2].sender, "rover");
  EXPECT_THAT(client.violations, IsEmpty());
}

TEST_F(VrpnServerTest, TellsEveryClientOfALostBodyAndStopsItsReports) {
  start();
  StrictClient a;
  StrictClient b;
  a.connect(port_);
  b.request(port_);
  clients_ = {&a, &b};
  ASSERT_TRUE(until([&] { return a.ready() && b.ready(); }));
  publish();
  auto lost = frame();
  lost->bodies[0].valid = false;
  lost->bodies[0].state = BodyState::kLost;
  server_->publish(lost);
  ASSERT_TRUE(until([&] { return a.reports.size() == 6 && b.reports.size() == 6 && b.texts.size() == 1; }));
  ASSERT_EQ(a.texts.size(), 1u);
  EXPECT_EQ(a.texts[0].sender, "arm");
  EXPECT_EQ(a.texts[0].severity, 1u);
  EXPECT_EQ(a.reports[4].sender, "drone");
}

TEST_F(VrpnServerTest, AnUnknownNameNeverReachesAnotherClient) {
  start();
  StrictClient asking;
  StrictClient other;
  asking.connect(port_);
  other.connect(port_);
  clients_ = {&asking, &other};
  ASSERT_TRUE(until([&] { return asking.ready() && other.ready(); }));
  asking.ask("ghost", "vrpn_Base ping_message");
  ASSERT_TRUE(until([&] { return asking.texts.size() == 1; }));
  StrictClient late;
  late.connect(port_);
  clients_.push_back(&late);
  ASSERT_TRUE(until([&] { return late.ready(); }));
  publish();
  ASSERT_TRUE(until([&] { return other.reports.size() == 4; }));
  EXPECT_THAT(asking.texts[0].text, HasSubstr("arm, drone"));
  EXPECT_THAT(asking.pongs, IsEmpty());
  EXPECT_THAT(other.bodies(), ElementsAre("arm", "drone"));
  EXPECT_THAT(late.bodies(), ElementsAre("arm", "drone"));
  EXPECT_THAT(other.texts, IsEmpty());
}

TEST_F(VrpnServerTest, AStalledTcpClientDisturbsNobodyAndLosesFrames) {
  std::vector<std::string> many;
  for (int i = 0; i < 40; ++i) many.push_back("body" + std::to_string(i));
  start(many);
  StrictClient stalled;
  StrictClient reading;
  stalled.connect(port_);
  reading.connect(port_);
  clients_ = {&stalled, &reading};
  ASSERT_TRUE(until([&] { return stalled.ready() && reading.ready(); }));
  stalled.stop_reading();
  constexpr int kFrames = 2000;  // 40 bodies · 184 bytes · 2000 = 15 MB, more than any socket buffer takes
  for (int i = 0; i < kFrames; ++i) {
    publish();
    const std::size_t wanted = static_cast<std::size_t>(i + 1) * 80;
    ASSERT_TRUE(until([&] { return reading.reports.size() == wanted; }));
  }
  EXPECT_THAT(reading.violations, IsEmpty());
  const auto all = status();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_GT(all[0].frames_dropped, 100u);
  EXPECT_EQ(all[0].frames_sent + all[0].frames_dropped, static_cast<std::uint64_t>(kFrames));
  EXPECT_EQ(all[1].frames_dropped, 0u);
  EXPECT_EQ(all[1].frames_sent, static_cast<std::uint64_t>(kFrames));
}

TEST_F(VrpnServerTest, ClosesAClientThatLeavesReliableDataLying) {
  std::vector<std::string> many;
  for (int i = 0; i < 40; ++i) many.push_back("body" + std::to_string(i));
  start(many);
  StrictClient stalled;
  stalled.connect(port_);
  clients_ = {&stalled};
  ASSERT_TRUE(until([&] { return stalled.ready(); }));
  stalled.stop_reading();
  ASSERT_TRUE(until([&] {
    publish();
    return status()[0].frames_dropped > 50;  // the kernel's buffers have stopped growing
  }));
  pass(std::chrono::seconds(10));
  EXPECT_EQ(status().size(), 1u) << "stuck poses alone are no reason";
  stalled.ask("body0", "vrpn_Base ping_message");
  steps(150);
  pass(std::chrono::seconds(3));
  EXPECT_THAT(status(), IsEmpty());
}

TEST_F(VrpnServerTest, ClosesWhoSendsNoCookie) {
  start();
  StrictClient silent(StrictClient::CookieOrder::kAfterServer);
  silent.connect(port_);
  silent.stop_reading();  // so it never answers
  clients_ = {&silent};
  steps(20);
  pass(std::chrono::seconds(6));
  StrictClient fine;
  fine.connect(port_);
  clients_.push_back(&fine);
  ASSERT_TRUE(until([&] { return fine.ready(); }));
  silent.resume_reading();
  EXPECT_TRUE(until([&] { return silent.closed_by_server(); }));
}

TEST_F(VrpnServerTest, ClosesOnlyTheClientThatSendsGarbage) {
  start();
  StrictClient good;
  good.connect(port_);
  StrictClient wrong_major(StrictClient::CookieOrder::kAfterServer);
  wrong_major.connect(port_);
  wrong_major.send_raw(from_hex("7672706e3a207665722e2030362e3338 2020 30 0000000000"));
  StrictClient absurd;
  absurd.connect(port_);
  clients_ = {&good, &wrong_major, &absurd};
  ASSERT_TRUE(until([&] { return good.ready() && absurd.ready() && wrong_major.closed_by_server(); }));
  absurd.send_raw(from_hex("ffffffff 00000000 00000000"));
  ASSERT_TRUE(until([&] { return absurd.closed_by_server(); }));
  publish();
  ASSERT_TRUE(until([&] { return good.reports.size() == 4; }));
  EXPECT_EQ(status().size(), 1u);
}

TEST_F(VrpnServerTest, SurvivesRandomBytesByTcpAndUdp) {
  start();
  StrictClient good;
  good.request(port_);
  clients_ = {&good};
  ASSERT_TRUE(until([&] { return good.ready(); }));
  std::mt19937 random(11);
  std::uniform_int_distribution<int> byte(0, 255);
  const int udp = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in server{};
  server.sin_family = AF_INET;
  server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  server.sin_port = htons(port_);
  for (int i = 0; i < 40; ++i) {
    std::vector<std::byte> noise(1 + static_cast<std::size_t>(i) * 37);
    for (auto& b : noise) b = static_cast<std::byte>(byte(random));
    ::sendto(udp, noise.data(), noise.size(), 0, reinterpret_cast<const sockaddr*>(&server), sizeof(server));
    StrictClient raw(StrictClient::CookieOrder::kAfterServer);
    raw.connect(port_);
    if (i % 2 == 0) raw.send_raw(from_hex("7672706e3a207665722e2030372e3338 2020 30 0000000000"));
    raw.send_raw(noise);
    steps(2);
  }
  ::close(udp);
  publish();
  ASSERT_TRUE(until([&] { return good.reports.size() == 4; }));
  EXPECT_THAT(good.violations, IsEmpty());
  ASSERT_TRUE(until([&] { return status().size() == 1; }));
}

TEST_F(VrpnServerTest, TurnsAwayClientsAboveTheLimit) {
  config_.max_clients = 2;
  start();
  StrictClient a;
  StrictClient b;
  StrictClient c;
  a.connect(port_);
  b.connect(port_);
  clients_ = {&a, &b};
  ASSERT_TRUE(until([&] { return a.ready() && b.ready(); }));
  c.connect(port_);
  clients_.push_back(&c);
  ASSERT_TRUE(until([&] { return c.closed_by_server(); }));
  EXPECT_EQ(status().size(), 2u);
}

TEST_F(VrpnServerTest, RestartsOnTheSamePortAtOnce) {
  start();
  StrictClient first;
  first.connect(port_);
  clients_ = {&first};
  ASSERT_TRUE(until([&] { return first.ready(); }));
  server_->stop();
  server_.reset();
  ASSERT_TRUE(until([&] { return first.closed_by_server(); }));
  start();  // port_ is that of the first run
  StrictClient second;
  second.connect(port_);
  clients_ = {&second};
  EXPECT_TRUE(until([&] { return second.ready(); }));
}

TEST_F(VrpnServerTest, NamesPortAndRemedyWhenThePortIsInUse) {
  start();
  config_.port = port_;
  const auto second = start_vrpn_server(io_, config_, make_scene_frame({})->model, clock_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text(), HasSubstr("port " + std::to_string(port_) + " is in use"));
  EXPECT_THAT(second.error().text(), HasSubstr("streaming.vrpn.port"));
}

TEST_F(VrpnServerTest, NamesTheAddressThatThisMachineDoesNotHave) {
  config_.address = "192.0.2.77";  // reserved for documentation
  config_.port = 0;
  const auto server = start_vrpn_server(io_, config_, make_scene_frame({})->model, clock_);
  ASSERT_FALSE(server);
  EXPECT_THAT(server.error().text(), HasSubstr("192.0.2.77"));
  EXPECT_THAT(server.error().text(), HasSubstr("streaming.vrpn.address"));
}

TEST_F(VrpnServerTest, StatusNamesPeerTransportAndContent) {
  config_.acceleration = true;
  start();
  StrictClient client;
  client.connect(port_);
  clients_ = {&client};
  ASSERT_TRUE(until([&] { return client.ready(); }));
  clock_.advance(std::chrono::seconds(7));
  const auto all = status();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].protocol, "vrpn");
  EXPECT_THAT(all[0].peer, HasSubstr("127.0.0.1:"));
  EXPECT_THAT(all[0].peer, HasSubstr(" tcp"));
  EXPECT_EQ(all[0].detail, "z-up m, velocity on, acceleration on");
  EXPECT_DOUBLE_EQ(all[0].connected_s, 7.0);
}

}  // namespace
}  // namespace fiducap::vrpn
