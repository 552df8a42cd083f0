#include "streaming/vrpn/vrpn.hpp"

#include <gmock/gmock.h>

#include <random>

#include "strict_client.hpp"
#include "support/hex.hpp"
#include "support/loopback_socket.hpp"
#include "unit/streaming/server_fixture.hpp"

namespace fiducap::vrpn {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr double kRounding = 1e-12;

class VrpnServerTest : public ProtocolServerTest<StrictClient, VrpnConfig> {
 protected:
  Expected<std::unique_ptr<Streamer>> make_server(
      std::shared_ptr<const SceneModel> model) override {
    return start_vrpn_server(io_, config_, std::move(model), clock_);
  }
  void TearDown() override { EXPECT_THAT(client_.violations, IsEmpty()); }
  /// Connects by TCP and waits for the descriptions.
  void join(StrictClient& client) {
    client.connect(port_);
    wait_until_ready(client);
  }
  /// Requests a connection by a datagram and waits for the descriptions.
  void join_by_request(StrictClient& client, int times = 1, bool offer_udp = true) {
    client.request(port_, times, offer_udp);
    wait_until_ready(client);
  }
  /// Publishes a frame; each client then has this many reports.
  void publish_to(std::initializer_list<StrictClient*> clients, std::size_t reports) {
    publish();
    for (auto* client : clients)
      ASSERT_TRUE(until([&] { return client->reports.size() == reports; }));
  }

  StrictClient client_;  ///< Must find no violation.

 private:
  void wait_until_ready(StrictClient& client) {
    clients_.push_back(&client);
    ASSERT_TRUE(until([&] { return client.ready(); }));
  }
};

TEST_F(VrpnServerTest, ServesADirectClientByTcp) {
  start();
  join(client_);
  EXPECT_THAT(client_.bodies(), ElementsAre("arm", "drone"));
  publish_to({&client_}, 4);
  EXPECT_EQ(client_.reports[0].sender, "arm");
  EXPECT_EQ(client_.reports[0].type, "vrpn_Tracker Pos_Quat");
  EXPECT_EQ(client_.reports[1].type, "vrpn_Tracker Velocity");
  EXPECT_EQ(client_.reports[2].sender, "drone");
  EXPECT_FALSE(client_.reports[0].udp);
  EXPECT_EQ(client_.reports[2].values[0], 2.0);
  // 2023-11-14 22:13:25.010 UTC, the stamp of the frame; doubles hold it to less than a
  // microsecond.
  EXPECT_NEAR(client_.reports[3].utc_s, 1700000005.010, 1e-6);
}

TEST_F(VrpnServerTest, ServesARequestingClientByUdp) {
  start();
  join_by_request(client_);
  EXPECT_THAT(status().at(0).peer, HasSubstr(" udp"));
  publish();
  publish_to({&client_}, 8);
  EXPECT_THAT(client_.reports, Each(Field(&StrictClient::Report::udp, true)));
  EXPECT_EQ(status().at(0).frames_sent, 2u);
}

TEST_F(VrpnServerTest, SensorsMoveWithTheirBodyAlsoUnderAnAlias) {
  config_.velocity = false;
  config_.aliases = {{"drone", "cf7"}};
  const Pose X_PS{Eigen::Quaterniond(0, 1, 0, 0), {0.1, 0.2, -0.3}};
  config_.sensors = {{"drone", X_PS}};
  start();
  StrictClient by_tcp, by_udp;
  for (auto* client : {&by_tcp, &by_udp}) client->expect_sensors(2);
  join(by_tcp);
  join_by_request(by_udp);
  EXPECT_THAT(by_tcp.bodies(), ElementsAre("arm", "cf7"));
  const auto sent = frame();
  server_->publish(sent);
  ASSERT_TRUE(until([&] { return by_tcp.reports.size() == 3 && by_udp.reports.size() == 3; }));
  const Pose X_WS = sent->bodies[1].X_WP * X_PS;
  for (const auto* client : clients_) {
    EXPECT_EQ(client->reports[1].sensor, 0);
    const auto& extra = client->reports[2];
    EXPECT_EQ(extra.sender, "cf7");
    EXPECT_EQ(extra.sensor, 1);
    ASSERT_EQ(extra.values.size(), 7u);
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(extra.values[static_cast<std::size_t>(i)], X_WS.p[i], kRounding);
    const Eigen::Quaterniond q(extra.values[6], extra.values[3], extra.values[4], extra.values[5]);
    EXPECT_NEAR(std::abs(q.dot(X_WS.q)), 1.0, kRounding);
    EXPECT_THAT(client->violations, IsEmpty());
  }
  by_tcp.ask("cf7", "vrpn_Tracker Request_Unit_To_Sensor");
  ASSERT_TRUE(until([&] { return by_tcp.answers["vrpn_Tracker Unit_To_Sensor"] == 2; }))
      << "one per sensor";
}

TEST_F(VrpnServerTest, SendsReportsByTcpWhenUdpIsOffOrNotOffered) {
  config_.udp_reports = false;
  start();
  StrictClient offering, not_offering;
  join_by_request(offering);
  join_by_request(not_offering, 1, false);
  publish_to({&offering, &not_offering}, 4);
  EXPECT_THAT(offering.reports, Each(Field(&StrictClient::Report::udp, false)));
  EXPECT_THAT(offering.violations, IsEmpty());
}

TEST_F(VrpnServerTest, AcceptsBothCookieOrdersInBothModes) {
  start();
  StrictClient a(StrictClient::CookieOrder::kAfterServer),
      b(StrictClient::CookieOrder::kAfterServer), c(StrictClient::CookieOrder::kFirst);
  join(a);
  join_by_request(b);
  join_by_request(c);
  for (const auto* client : clients_) EXPECT_THAT(client->violations, IsEmpty());
}

TEST_F(VrpnServerTest, AnswersPingsAndRequests) {
  start();
  join(client_);
  client_.ask("drone", "vrpn_Base ping_message");
  client_.ask("arm", "vrpn_Tracker Request_Tracker_To_Room");
  client_.ask("arm", "vrpn_Tracker Request_Unit_To_Sensor");
  client_.ask("arm", "vrpn_Tracker Request_Tracker_Workspace");
  ASSERT_TRUE(until([&] { return client_.answers.size() == 3; }));
  EXPECT_THAT(client_.pongs, ElementsAre("drone"));
}

TEST_F(VrpnServerTest, DescribesAnAddedBodyBeforeItsFirstReport) {
  start({"arm"});
  join(client_);
  names_ = {"arm", "rover"};
  auto later = frame();
  auto model = std::make_shared<SceneModel>(*later->model);
  model->generation = 2;
  later->model = model;
  server_->publish(later);
  ASSERT_TRUE(until([&] { return client_.reports.size() == 4; }));
  EXPECT_THAT(client_.bodies(), ElementsAre("arm", "rover"));
  EXPECT_EQ(client_.reports[2].sender, "rover");
}

TEST_F(VrpnServerTest, ReportsALostBodyToEveryClientAndStopsItsReports) {
  start();
  StrictClient a, b;
  join(a);
  join_by_request(b);
  publish();
  auto lost = frame();
  lost->bodies[0].valid = false;
  lost->bodies[0].state = BodyState::kLost;
  server_->publish(lost);
  ASSERT_TRUE(
      until([&] { return a.reports.size() == 6 && b.reports.size() == 6 && b.texts.size() == 1; }));
  ASSERT_EQ(a.texts.size(), 1u);
  EXPECT_EQ(a.texts[0].sender, "arm");
  EXPECT_EQ(a.texts[0].severity, 1u);
  EXPECT_EQ(a.reports[4].sender, "drone");
}

TEST_F(VrpnServerTest, RestartsOnTheSamePortAtOnce) {
  start();
  StrictClient first;
  join(first);
  server_->stop();
  server_.reset();
  ASSERT_TRUE(until([&] { return first.closed_by_server(); }));
  start();  // port_ is that of the first run
  StrictClient second;
  join(second);
}

TEST_F(VrpnServerTest, ReportsAPortInUseAndAForeignAddressWithRemedy) {
  start();
  config_.port = port_;
  const auto second = start_vrpn_server(io_, config_, make_scene_frame({})->model, clock_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text(), HasSubstr("port " + std::to_string(port_) + " is in use"));
  EXPECT_THAT(second.error().text(), HasSubstr("streaming.vrpn.port"));
  config_.address = "192.0.2.77";  // reserved for documentation
  config_.port = 0;
  const auto third = start_vrpn_server(io_, config_, make_scene_frame({})->model, clock_);
  ASSERT_FALSE(third);
  EXPECT_THAT(third.error().text(), HasSubstr("192.0.2.77"));
  EXPECT_THAT(third.error().text(), HasSubstr("streaming.vrpn.address"));
}

TEST_F(VrpnServerTest, StatusShowsPeerTransportAndContent) {
  config_.acceleration = true;
  start();
  join(client_);
  clock_.advance(std::chrono::seconds(7));
  const auto all = status();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].protocol, "vrpn");
  EXPECT_THAT(all[0].peer, HasSubstr("127.0.0.1:"));
  EXPECT_THAT(all[0].peer, HasSubstr(" tcp"));
  EXPECT_EQ(all[0].detail, "z-up m, velocity on, acceleration on");
  EXPECT_DOUBLE_EQ(all[0].connected_s, 7.0);
}

// Clients that stall, flood or send garbage must not affect the others.

TEST_F(VrpnServerTest, RepeatedRequestsMakeOneConnection) {
  start();
  join_by_request(client_, 5);
  steps(20);
  EXPECT_EQ(client_.extra_connections(), 0);
  EXPECT_THAT(status(), SizeIs(1));
}

TEST_F(VrpnServerTest, AnUnknownNameNeverReachesAnotherClient) {
  start();
  StrictClient asking, other, late;
  join(asking);
  join(other);
  asking.ask("ghost", "vrpn_Base ping_message");
  ASSERT_TRUE(until([&] { return asking.texts.size() == 1; }));
  join(late);
  publish_to({&other}, 4);
  EXPECT_THAT(asking.texts[0].text, HasSubstr("arm, drone"));
  EXPECT_THAT(asking.pongs, IsEmpty());
  EXPECT_THAT(other.bodies(), ElementsAre("arm", "drone"));
  EXPECT_THAT(late.bodies(), ElementsAre("arm", "drone"));
  EXPECT_THAT(other.texts, IsEmpty());
}

TEST_F(VrpnServerTest, DropsFramesOnlyOfAStalledTcpClient) {
  start(numbered_names(40));
  StrictClient stalled, reading;
  join(stalled);
  join(reading);
  stalled.stop_reading();
  // 40 bodies · 184 bytes · 2000 = 15 MB, more than any socket buffer takes.
  constexpr std::uint64_t kFrames = 2000;
  for (std::size_t i = 1; i <= kFrames; ++i) publish_to({&reading}, i * 80);
  EXPECT_THAT(reading.violations, IsEmpty());
  const auto all = status();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_GT(all[0].frames_dropped, 100u);
  EXPECT_EQ(all[0].frames_sent + all[0].frames_dropped, kFrames);
  EXPECT_EQ(all[1].frames_dropped, 0u);
  EXPECT_EQ(all[1].frames_sent, kFrames);
}

TEST_F(VrpnServerTest, ClosesAClientThatReadsNothingForFiveSeconds) {
  start(numbered_names(40));
  join(client_);
  client_.stop_reading();
  ASSERT_TRUE(until([&] {
    publish();
    return status()[0].frames_dropped > 50;  // the kernel's buffers have stopped growing
  }));
  pass(std::chrono::seconds(4));
  EXPECT_THAT(status(), SizeIs(1));
  pass(std::chrono::seconds(2));
  EXPECT_THAT(status(), IsEmpty());
}

TEST_F(VrpnServerTest, ClosesAClientThatSendsNoCookie) {
  start();
  StrictClient silent(StrictClient::CookieOrder::kAfterServer);
  silent.connect(port_);
  silent.stop_reading();  // so it never answers
  clients_ = {&silent};
  steps(20);
  pass(std::chrono::seconds(6));
  StrictClient fine;
  join(fine);
  silent.resume_reading();
  EXPECT_TRUE(until([&] { return silent.closed_by_server(); }));
}

TEST_F(VrpnServerTest, ClosesOnlyTheClientThatSendsGarbage) {
  start();
  StrictClient good, wrong_major(StrictClient::CookieOrder::kAfterServer), absurd;
  wrong_major.connect(port_);
  wrong_major.send_raw(from_hex("7672706e3a207665722e2030362e3338 2020 30 0000000000"));
  clients_ = {&wrong_major};
  join(good);
  join(absurd);
  ASSERT_TRUE(until([&] { return wrong_major.closed_by_server(); }));
  absurd.send_raw(from_hex("ffffffff 00000000 00000000"));
  ASSERT_TRUE(until([&] { return absurd.closed_by_server(); }));
  publish_to({&good}, 4);
  EXPECT_THAT(status(), SizeIs(1));
}

TEST_F(VrpnServerTest, SurvivesRandomBytesByTcpAndUdp) {
  start();
  StrictClient good;
  join_by_request(good);
  std::mt19937 random(11);
  std::uniform_int_distribution<int> byte(0, 255);
  const int udp = bound_socket(SOCK_DGRAM);
  for (int i = 0; i < 40; ++i) {
    std::vector<std::byte> noise(1 + static_cast<std::size_t>(i) * 37);
    for (auto& b : noise) b = static_cast<std::byte>(byte(random));
    send_datagram(udp, noise, port_);
    StrictClient raw(StrictClient::CookieOrder::kAfterServer);
    raw.connect(port_);
    if (i % 2 == 0) raw.send_raw(from_hex("7672706e3a207665722e2030372e3338 2020 30 0000000000"));
    raw.send_raw(noise);
    steps(2);
  }
  ::close(udp);
  publish_to({&good}, 4);
  EXPECT_THAT(good.violations, IsEmpty());
  ASSERT_TRUE(until([&] { return status().size() == 1; }));
}

TEST_F(VrpnServerTest, ClosesClientsAboveTheLimit) {
  config_.max_clients = 2;
  start();
  StrictClient a, b, c;
  join(a);
  join(b);
  c.connect(port_);
  clients_.push_back(&c);
  ASSERT_TRUE(until([&] { return c.closed_by_server(); }));
  EXPECT_THAT(status(), SizeIs(2));
}

}  // namespace
}  // namespace fiducap::vrpn
