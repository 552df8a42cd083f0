#include "streaming/net/limits.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace fiducap::net {
namespace {

constexpr Peer kLocal{0x7f000001, 1};

Peer remote(std::uint32_t host) { return {0x0a000000 + host, 1}; }

TEST(PlaceFor, AddressWithMostConnectionsYieldsToOneWithTwoFewer) {
  const std::vector<Peer> holders{remote(1), remote(1), remote(1), remote(2)};
  EXPECT_TRUE(place_for(remote(2), holders, 4).instead_of->same_address(remote(1)));
  EXPECT_TRUE(place_for(remote(3), holders, 4).instead_of->same_address(remote(1)));
  EXPECT_FALSE(place_for(remote(1), holders, 4).is_there);
  const Place free = place_for(remote(1), holders, 5);
  EXPECT_TRUE(free.is_there);
  EXPECT_FALSE(free.instead_of);
}

TEST(PlaceFor, ClientsKeepTheirPlaceExceptForTheLocalOperator) {
  const std::vector<Peer> holders{remote(1), remote(2), remote(3), remote(4)};
  EXPECT_FALSE(place_for(remote(5), holders, 4).is_there);
  EXPECT_TRUE(place_for(kLocal, holders, 4).is_there);
  EXPECT_FALSE(place_for(kLocal, holders, 4).instead_of->is_loopback());
}

TEST(PlaceFor, LocalConnectionsYieldToRemoteOnesOnly) {
  const std::vector<Peer> half{remote(1), remote(2), kLocal, kLocal.with_port(2)};
  EXPECT_FALSE(place_for(kLocal.with_port(3), half, 4).is_there) << "they have half of the places";
  const std::vector<Peer> all(4, kLocal);
  EXPECT_FALSE(place_for(kLocal.with_port(9), all, 4).is_there);
  EXPECT_TRUE(place_for(remote(1), all, 4).is_there);
}

TEST(PlaceFor, LocalConnectionsReplaceAFixedNumberOfRemoteOnes) {
  std::vector<Peer> holders;
  for (std::uint32_t i = 1; i <= 20; ++i) holders.push_back(remote(i));
  for (std::ptrdiff_t i = 0; i < kOperatorPlaces; ++i) {
    const Place place = place_for(kLocal, holders, 20);
    ASSERT_TRUE(place.instead_of);
    std::erase(holders, *place.instead_of);
    holders.push_back(kLocal);
  }
  EXPECT_FALSE(place_for(kLocal, holders, 20).is_there);
}

TEST(WrongProofs, ShutOutTheAddressThatSentThemOnly) {
  WrongProofs wrong;
  const Instant now = instant_from_ns(1'000'000'000);
  for (std::uint64_t address = 1; address <= 10'000; ++address) {
    for (int i = 0; i < WrongProofs::kAllowed; ++i) wrong.note(address, now);
    EXPECT_TRUE(wrong.shut_out(address, now));
    EXPECT_FALSE(wrong.shut_out(address + 256, now));
  }
  EXPECT_FALSE(wrong.shut_out(20'000, now));
}

}  // namespace
}  // namespace fiducap::net
