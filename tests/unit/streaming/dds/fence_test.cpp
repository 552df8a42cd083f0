// Announcements of participants (SPDP) with the address of a victim. A reply proves that the
// middleware has processed the datagrams before it.
#include "middleware/network.hpp"

#include <gmock/gmock.h>

#include <memory>
#include <string>
#include <vector>

#include "forged_participant.hpp"
#include "middleware/participant.hpp"
#include "support/network_namespace.hpp"

namespace fiducap::dds {
namespace {

constexpr int kDomain = 47;
constexpr int kMulticastPort = 7400 + 250 * kDomain;
constexpr int kUnicastPort = kMulticastPort + 10;  // of the first participant
constexpr const char* kGroup = "239.255.0.1";
constexpr const char* kBeyond = "192.168.213.66";
constexpr int kTimeout_ms = 10'000;

class DdsFence : public testing::Test {
 protected:
  void SetUp() override {
    if (!hosts_.problem.empty()) GTEST_SKIP() << hosts_.problem;
    const std::string beyond = kBeyond;
    ASSERT_TRUE(hosts_.client.run("ip address add " + beyond + "/32 dev lo").done);
    ASSERT_TRUE(hosts_.server.run("ip route add " + beyond + " via " + TwoHosts::kClient).done);
  }
  void TearDown() override {
    hosts_.server.on([this] { participant_.reset(); });
  }
  void take_part(const std::string& interface, const std::vector<std::string>& peers = {}) {
    hosts_.server.on([&] {
      auto joined = Participant::open({.domain = kDomain, .interface = interface, .peers = peers});
      ASSERT_TRUE(joined) << joined.error().text();
      participant_ = *joined;
    });
  }
  std::unique_ptr<Socket> socket(NetworkNamespace& in, const std::string& address, int port = 0) {
    std::unique_ptr<Socket> made;
    in.on([&] { made = std::make_unique<Socket>(address, port); });
    return made;
  }
  std::unique_ptr<Socket> outside(const std::string& address) {
    return socket(hosts_.client, address);
  }
  /// Announces participant `number` at the address of `target`.
  static void announce(const Socket& from, std::uint32_t number, const std::string& address,
                       const Socket& target, const std::string& to = TwoHosts::kServer) {
    from.send(announcement(number, address, target.port()), to, kUnicastPort);
  }
  /// The neighbour gets a reply, the victim none.
  static void expect_replies(const Socket& neighbour, const Socket& victim) {
    EXPECT_TRUE(neighbour.hears_within(kTimeout_ms));
    EXPECT_FALSE(victim.has_heard());
  }

  TwoHosts hosts_;
  std::shared_ptr<Participant> participant_;
};

TEST_F(DdsFence, LoopbackReceivesNothingFromOutside) {
  take_part("lo");
  const auto victim = socket(hosts_.server, "127.0.0.1");
  const auto neighbour = socket(hosts_.server, "127.0.0.1");
  announce(*outside(TwoHosts::kClient), 1, "127.0.0.1", *victim);
  announce(*neighbour, 2, "127.0.0.1", *neighbour, "127.0.0.1");
  expect_replies(*neighbour, *victim);
}

// The card is used as well, so that programs of this machine with default settings are found.
TEST_F(DdsFence, LoopbackReceivesNoMulticastFromOutside) {
  take_part("lo");
  const auto victim = socket(hosts_.server, "127.0.0.1");
  const auto neighbour = socket(hosts_.server, "127.0.0.1");
  const auto outsider = outside(TwoHosts::kClient);
  hosts_.client.on([&] {
    outsider->join(kGroup, TwoHosts::kClient);
    outsider->send(announcement(1, "127.0.0.1", victim->port()), kGroup, kMulticastPort);
  });
  announce(*neighbour, 2, "127.0.0.1", *neighbour, "127.0.0.1");
  expect_replies(*neighbour, *victim);
}

TEST_F(DdsFence, LoopbackHearsThisMachineByItsCardAndSendsNothingOutside) {
  const auto group = socket(hosts_.client, "0.0.0.0", kMulticastPort);
  hosts_.client.on([&] { group->join(kGroup, TwoHosts::kClient); });
  const auto local_group = socket(hosts_.server, "0.0.0.0", kMulticastPort);
  hosts_.server.on([&] { local_group->join(kGroup, TwoHosts::kServer); });
  take_part("lo");
  const auto local = socket(hosts_.server, TwoHosts::kServer);
  EXPECT_TRUE(local_group->hears_within(kTimeout_ms)) << "the server's own announcement";
  hosts_.server.on([&] {
    local->join(kGroup, TwoHosts::kServer);
    local->set_multicast_ttl(0);  // only the server's datagrams could come out
    local->send(announcement(1, TwoHosts::kServer, local->port()), kGroup, kMulticastPort);
  });
  EXPECT_TRUE(local->hears_within(kTimeout_ms)) << "a reply to the address of the card";
  EXPECT_FALSE(group->has_heard());
}

TEST_F(DdsFence, LoopbackIsLeftWhenThereIsAnotherCard) {
  ASSERT_TRUE(hosts_.server.run("ip link set fdc0 down").done);
  take_part("lo");
  hosts_.server.on([&] { participant_->look_at_cards(); });
  EXPECT_FALSE(participant_->is_to_be_left()) << "no card before and now";
  ASSERT_TRUE(hosts_.server.run("ip link set fdc0 up").done);
  hosts_.server.on([&] { participant_->look_at_cards(); });
  EXPECT_TRUE(participant_->is_to_be_left());
}

TEST_F(DdsFence, InterfaceReceivesFromItsNetworkOnly) {
  take_part(TwoHosts::kServer);
  const auto victim = outside(TwoHosts::kClient);
  const auto neighbour = outside(TwoHosts::kClient);
  announce(*outside(kBeyond), 1, TwoHosts::kClient, *victim);
  announce(*neighbour, 2, TwoHosts::kClient, *neighbour);
  expect_replies(*neighbour, *victim);
}

TEST_F(DdsFence, SendsNoRepliesBeyondItsNetwork) {
  take_part(TwoHosts::kServer);
  const auto victim = outside(kBeyond);
  const auto neighbour = outside(TwoHosts::kClient);
  announce(*neighbour, 1, kBeyond, *victim);
  announce(*neighbour, 2, TwoHosts::kClient, *neighbour);
  expect_replies(*neighbour, *victim);
}

TEST_F(DdsFence, ConfiguredPeersBeyondGetReplies) {
  take_part(TwoHosts::kServer, {kBeyond});
  const auto peer = outside(kBeyond);
  announce(*peer, 1, kBeyond, *peer);
  EXPECT_TRUE(peer->hears_within(kTimeout_ms));
}

TEST_F(DdsFence, MulticastOfItsNetworkPassesBothWays) {
  const auto group = socket(hosts_.client, "0.0.0.0", kMulticastPort);
  hosts_.client.on([&] { group->join(kGroup, TwoHosts::kClient); });
  take_part(TwoHosts::kServer);
  EXPECT_TRUE(group->hears_within(kTimeout_ms)) << "the server's own announcement";
  const auto neighbour = outside(TwoHosts::kClient);
  hosts_.client.on([&] {
    neighbour->join(kGroup, TwoHosts::kClient);
    neighbour->send(announcement(1, TwoHosts::kClient, neighbour->port()), kGroup, kMulticastPort);
  });
  EXPECT_TRUE(neighbour->hears_within(kTimeout_ms));
}

}  // namespace
}  // namespace fiducap::dds
