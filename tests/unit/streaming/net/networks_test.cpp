#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "middleware/net/networks.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::net {
namespace {

TEST(Peer, ReadsWhatItWrites) {
  const Peer peer{0x0a4d0107, 1511};
  EXPECT_EQ(text_of(peer), "10.77.1.7:1511");
  EXPECT_EQ(parse_peer("10.77.1.7:1511"), peer);
  EXPECT_EQ(peer.ipv4(), 0x0a4d0107u);
}

TEST(Peer, WritesIPv6InBrackets) {
  Peer peer;
  peer.address = {0x20, 0x01, 0x0d, 0xb8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7};
  peer.port = 80;
  EXPECT_EQ(text_of(peer), "[2001:db8::7]:80");
  EXPECT_FALSE(peer.is_loopback());
}

TEST(Peer, KnowsTheLoopbackOfBothFamilies) {
  Peer v6;
  v6.address[15] = 1;
  EXPECT_TRUE(v6.is_loopback());
  EXPECT_TRUE((Peer{0x7f090909, 1}.is_loopback()));
  EXPECT_FALSE((Peer{0x0a000001, 1}.is_loopback()));
}

TEST(Peer, GoesThroughTheKernelsFormUnchanged) {
  const Peer v4{0x0a000007, 4000};
  EXPECT_EQ(SocketAddress(v4, true).peer(), v4);
  EXPECT_EQ(SocketAddress(v4, false).peer(), v4) << "mapped, on a socket that speaks IPv6";
  Peer v6;
  v6.address = {0xfe, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7};
  v6.scope = 2;
  v6.port = 9;
  EXPECT_EQ(SocketAddress(v6, false).peer(), v6);
}

TEST(Peer, OfOneAddressShareAHashWhateverThePort) {
  const std::array<std::uint64_t, 2> key{1, 2};
  EXPECT_EQ(address_hash(key, {0x0a000007, 1}), address_hash(key, {0x0a000007, 2}));
  EXPECT_NE(peer_hash(key, {0x0a000007, 1}), peer_hash(key, {0x0a000007, 2}));
}

Instant at(double seconds) { return Instant{} + from_seconds(1000 + seconds); }

TEST(Network, IsReadAndWrittenAsAdministratorsDo) {
  for (const std::string text :
       {"10.1.2.0/24", "10.0.0.7/32", "0.0.0.0/0", "192.168.128.0/17", "fd00:1::/64", "::1/128"}) {
    const auto network = parse_network(text);
    ASSERT_TRUE(network) << text;
    EXPECT_EQ(text_of(*network), text);
  }
  EXPECT_EQ(text_of(*parse_network("10.1.2.3/16")), "10.1.0.0/16") << "host bits do not count";
  EXPECT_EQ(text_of(*parse_network("10.1.2.3")), "10.1.2.3/32");
  for (const std::string text : {"", "10.0.0.0/33", "10.0.0.0/", "10.0.0.0/-1", "10.0.0.0/8x",
                                 "fd00::/129", "lab", "10.0.0/8", "/8"})
    EXPECT_FALSE(parse_network(text)) << text;
}

TEST(Network, ContainsItsAddressesWhateverThePort) {
  const Network lab = *parse_network("10.1.128.0/17");
  EXPECT_TRUE(lab.contains({0x0a018000, 1}));
  EXPECT_TRUE(lab.contains({0x0a01ffff, 65535}));
  EXPECT_FALSE(lab.contains({0x0a017fff, 1}));
  EXPECT_FALSE(parse_network("fd00::/8")->contains({0x0a018000, 1}));
  EXPECT_TRUE(parse_network("0.0.0.0/0")->contains({0x0a018000, 1}));
}

TEST(Network, ThisMachineIsAttachedToItsLoopback) {
  EXPECT_THAT(attached_networks(), testing::Contains(*parse_network("127.0.0.0/8")));
}

TEST(Network, TheUsualOneIsTheExpectedSubnet) {
  EXPECT_EQ(text_of(usual_network_of({0x0a010203, 9})), "10.1.2.0/24");
}

TEST(TrustedNetworks, FollowsTheCardsWithoutAskingAllTheTime) {
  int asked = 0;
  std::vector<Network> cards{*parse_network("10.0.0.0/24")};
  TrustedNetworks trusted({*parse_network("172.16.0.0/12")}, [&] {
    ++asked;
    return cards;
  });
  EXPECT_TRUE(trusted.contains({0xac100001, 1}, at(0))) << "configured";
  EXPECT_TRUE(trusted.contains({0x0a000001, 1}, at(0)));
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE(trusted.contains({0xc0a80001, 1}, at(0.004 * i)));
  EXPECT_EQ(asked, 1);
  cards = {*parse_network("192.168.0.0/24")};
  EXPECT_TRUE(trusted.contains({0xc0a80001, 1}, at(6))) << "a new card";
  EXPECT_FALSE(trusted.contains({0x0a000001, 1}, at(6))) << "one that went";
  EXPECT_EQ(asked, 2);
}

}  // namespace
}  // namespace fiducap::net
