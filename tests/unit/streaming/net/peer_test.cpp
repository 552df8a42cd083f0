#include "middleware/net/peer.hpp"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace fiducap::net
