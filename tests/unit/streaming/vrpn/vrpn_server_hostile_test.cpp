// Clients that stall, flood, lie or send garbage: the others must not notice.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <random>

#include "server_fixture.hpp"
#include "support/hex.hpp"

namespace fiducap::vrpn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

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

TEST_F(VrpnServerTest, AStalledTcpClientLosesFramesWithoutEffectOnOthers) {
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
  constexpr int kFrames =
      2000;  // 40 bodies · 184 bytes · 2000 = 15 MB, more than any socket buffer takes
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

TEST_F(VrpnServerTest, ClosesAClientThatReadsNothingForFiveSeconds) {
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
  pass(std::chrono::seconds(4));
  EXPECT_EQ(status().size(), 1u);
  pass(std::chrono::seconds(2));
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
  ASSERT_TRUE(
      until([&] { return good.ready() && absurd.ready() && wrong_major.closed_by_server(); }));
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
    ::sendto(udp, noise.data(), noise.size(), 0, reinterpret_cast<const sockaddr*>(&server),
             sizeof(server));
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

}  // namespace
}  // namespace fiducap::vrpn
