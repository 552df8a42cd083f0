// Announcements of participants (SPDP) that claim the address of a victim, sent as a stranger would
// send them. An answer proves that the middleware has read what came before it.
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
    NetworkConfig config;
    config.domain = kDomain;
    config.interface = interface;
    config.peers = peers;
    hosts_.server.on([&] {
      auto joined = Participant::open(config);
      ASSERT_TRUE(joined) << joined.error().text();
      participant_ = *joined;
    });
  }
  std::unique_ptr<Socket> socket(NetworkNamespace& in, const std::string& address, int port = 0) {
    std::unique_ptr<Socket> made;
    in.on([&] { made = std::make_unique<Socket>(address, port); });
    return made;
  }
  std::unique_ptr<Socket> theirs(const std::string& address) {
    return socket(hosts_.client, address);
  }

  TwoHosts hosts_;
  std::shared_ptr<Participant> participant_;
};

TEST_F(DdsFence, OnLoopbackNothingFromOutsideIsHeard) {
  take_part("lo");
  const auto victim = socket(hosts_.server, "127.0.0.1");
  const auto neighbour = socket(hosts_.server, "127.0.0.1");
  const auto stranger = theirs(TwoHosts::kClient);
  stranger->send(announcement(1, "127.0.0.1", victim->port()), TwoHosts::kServer, kUnicastPort);
  neighbour->send(announcement(2, "127.0.0.1", neighbour->port()), "127.0.0.1", kUnicastPort);
  EXPECT_TRUE(neighbour->hears_within(kTimeout_ms));
  EXPECT_FALSE(victim->has_heard());
}

TEST_F(DdsFence, OfACardItsOwnNetworkIsHeardAndNoSenderBeyond) {
  take_part(TwoHosts::kServer);
  const auto stranger = theirs(kBeyond);
  const auto victim = theirs(TwoHosts::kClient);
  const auto neighbour = theirs(TwoHosts::kClient);
  stranger->send(announcement(1, TwoHosts::kClient, victim->port()), TwoHosts::kServer,
                 kUnicastPort);
  neighbour->send(announcement(2, TwoHosts::kClient, neighbour->port()), TwoHosts::kServer,
                  kUnicastPort);
  EXPECT_TRUE(neighbour->hears_within(kTimeout_ms));
  EXPECT_FALSE(victim->has_heard());
}

TEST_F(DdsFence, ANeighbourCannotHaveAddressesBeyondAnswered) {
  take_part(TwoHosts::kServer);
  const auto victim = theirs(kBeyond);
  const auto neighbour = theirs(TwoHosts::kClient);
  neighbour->send(announcement(1, kBeyond, victim->port()), TwoHosts::kServer, kUnicastPort);
  neighbour->send(announcement(2, TwoHosts::kClient, neighbour->port()), TwoHosts::kServer,
                  kUnicastPort);
  EXPECT_TRUE(neighbour->hears_within(kTimeout_ms));
  EXPECT_FALSE(victim->has_heard());
}

TEST_F(DdsFence, PeersBeyondAreHeardAndAnswered) {
  take_part(TwoHosts::kServer, {kBeyond});
  const auto peer = theirs(kBeyond);
  peer->send(announcement(1, kBeyond, peer->port()), TwoHosts::kServer, kUnicastPort);
  EXPECT_TRUE(peer->hears_within(kTimeout_ms));
}

TEST_F(DdsFence, MulticastOfTheOwnNetworkPassesBothWays) {
  const auto group = socket(hosts_.client, "0.0.0.0", kMulticastPort);
  hosts_.client.on([&] { group->join(kGroup, TwoHosts::kClient); });
  take_part(TwoHosts::kServer);
  EXPECT_TRUE(group->hears_within(kTimeout_ms)) << "the server's own announcement";
  const auto neighbour = theirs(TwoHosts::kClient);
  hosts_.client.on([&] {
    neighbour->join(kGroup, TwoHosts::kClient);
    neighbour->send(announcement(1, TwoHosts::kClient, neighbour->port()), kGroup, kMulticastPort);
  });
  EXPECT_TRUE(neighbour->hears_within(kTimeout_ms));
}

}  // namespace
}  // namespace fiducap::dds
