#include "streaming/vrpn/vrpn.hpp"

#include <gmock/gmock.h>

#include "server_fixture.hpp"

namespace fiducap::vrpn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kRounding = 1e-12;

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
  // 2023-11-14 22:13:25.010 UTC, the stamp of the frame; doubles hold it to less than a
  // microsecond.
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

TEST_F(VrpnServerTest, SensorsMoveWithTheirBodyWhateverItIsCalled) {
  config_.velocity = false;
  config_.aliases = {{"drone", "cf7"}};
  const Pose X_PS{Eigen::Quaterniond(0, 1, 0, 0), {0.1, 0.2, -0.3}};
  config_.sensors = {{"drone", X_PS}};
  start();
  StrictClient by_tcp;
  StrictClient by_udp;
  by_tcp.connect(port_);
  by_udp.request(port_);
  clients_ = {&by_tcp, &by_udp};
  for (auto* client : clients_) client->expect_sensors(2);
  ASSERT_TRUE(until([&] { return by_tcp.ready() && by_udp.ready(); }));
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
  ASSERT_TRUE(
      until([&] { return offering.reports.size() == 4 && not_offering.reports.size() == 4; }));
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

TEST_F(VrpnServerTest, ReportsALostBodyToEveryClientAndStopsItsReports) {
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
