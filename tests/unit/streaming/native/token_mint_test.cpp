#include "streaming/native/registry.hpp"

#include <gtest/gtest.h>

#include <numeric>

namespace fiducap::native {
namespace {

constexpr std::array<std::uint64_t, 2> kKey{0x0706050403020100, 0x0f0e0d0c0b0a0908};
constexpr Duration kPeriod = std::chrono::seconds(10);
constexpr Instant kNow = instant_from_ns(1'000'000'000'000);

Peer ipv4(std::uint8_t last, std::uint16_t port) {
  Peer peer;
  peer.address = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 192, 0, 2, last};
  peer.port = port;
  return peer;
}

TEST(SipHash, MatchesThePaper) {
  // Appendix A of the paper: key 00 … 0f, input 00 … 0e.
  std::array<std::uint8_t, 15> input{};
  std::iota(input.begin(), input.end(), std::uint8_t{0});
  EXPECT_EQ(siphash(kKey, input), 0xa129ca6149be45e5u);
}

TEST(TokenIssuer, AcceptsItsTokenForOnePeriodAtLeastAndTwoAtMost) {
  const TokenIssuer tokens(kKey, kPeriod);
  const Peer peer = ipv4(1, 5000);
  const auto token = tokens.token(peer, kNow);
  EXPECT_TRUE(tokens.accepts(token, peer, kNow));
  EXPECT_TRUE(tokens.accepts(token, peer, kNow + kPeriod));
  EXPECT_FALSE(tokens.accepts(token, peer, kNow + 2 * kPeriod));
}

TEST(TokenIssuer, RefusesTheTokenOfAnotherAddressPortOrServer) {
  const TokenIssuer tokens(kKey, kPeriod);
  const auto token = tokens.token(ipv4(1, 5000), kNow);
  EXPECT_FALSE(tokens.accepts(token, ipv4(2, 5000), kNow));
  EXPECT_FALSE(tokens.accepts(token, ipv4(1, 5001), kNow));
  EXPECT_FALSE(tokens.accepts(0, ipv4(1, 5000), kNow));
  EXPECT_FALSE(TokenIssuer({1, 2}, kPeriod).accepts(token, ipv4(1, 5000), kNow));
}

TEST(TokenIssuer, CountsAnIPv6NetworkAsOneAddress) {
  const TokenIssuer tokens(kKey, kPeriod);
  Peer a;
  a.address = {0x20, 0x01, 0x0d, 0xb8, 0, 0, 0, 1, 1, 2, 3, 4, 5, 6, 7, 8};
  Peer b = a;
  b.address[15] = 9;
  EXPECT_EQ(tokens.address_hash(a), tokens.address_hash(b));
  EXPECT_NE(tokens.address_hash(ipv4(1, 1)), tokens.address_hash(ipv4(2, 1)));
}

}  // namespace
}  // namespace fiducap::native
