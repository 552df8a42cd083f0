#include "streaming/natnet/registry.hpp"

#include <gtest/gtest.h>

namespace fiducap::natnet {
namespace {

Peer lab(int host, int port = 4000) {
  return {0x0a000000U + static_cast<std::uint32_t>(host), static_cast<std::uint16_t>(port)};
}

class RegistryTest : public testing::Test {
 protected:
  static Instant at(double seconds) { return Instant{} + from_seconds(seconds); }
  Registry registry_{{3, 2, std::chrono::seconds(15)}};
};

TEST_F(RegistryTest, FindsWhoWasAdded) {
  ASSERT_NE(registry_.add(lab(1), at(0)), nullptr);
  EXPECT_NE(registry_.find(lab(1)), nullptr);
  EXPECT_EQ(registry_.find(lab(1, 4001)), nullptr) << "another port is another client";
}

TEST_F(RegistryTest, ForgetsAClientAfterItsTimeout) {
  registry_.add(lab(1), at(0));
  EXPECT_EQ(registry_.expire(at(15)), 0U);
  EXPECT_EQ(registry_.expire(at(15.001)), 1U);
  EXPECT_EQ(registry_.find(lab(1)), nullptr);
}

TEST_F(RegistryTest, WhenFullOnlyASilentClientGivesWay) {
  for (int i = 1; i <= 3; ++i) registry_.add(lab(i), at(0));
  EXPECT_EQ(registry_.add(lab(4), at(5)), nullptr);
  registry_.find(lab(1))->heard_at = at(9);
  registry_.find(lab(3))->heard_at = at(9);
  ASSERT_NE(registry_.add(lab(4), at(9)), nullptr);
  EXPECT_EQ(registry_.find(lab(2)), nullptr);
  EXPECT_NE(registry_.find(lab(1)), nullptr);
}

TEST_F(RegistryTest, OneAddressHasItsShareOnly) {
  EXPECT_NE(registry_.add(lab(1, 1), at(0)), nullptr);
  EXPECT_NE(registry_.add(lab(1, 2), at(0)), nullptr);
  EXPECT_EQ(registry_.add(lab(1, 3), at(0)), nullptr);
  EXPECT_NE(registry_.add(lab(2, 1), at(0)), nullptr);
}

TEST_F(RegistryTest, ThisMachineMayHaveAllPlaces) {
  for (std::uint16_t port = 1; port <= 3; ++port)
    EXPECT_NE(registry_.add({0x7f000001, port}, at(0)), nullptr);
}

TEST_F(RegistryTest, FixedOnesStayWhateverHappens) {
  registry_.add_fixed(lab(1), {3, 1}, at(0));
  EXPECT_FALSE(registry_.remove(lab(1)));
  EXPECT_EQ(registry_.expire(at(1000)), 0U);
  for (int i = 2; i <= 4; ++i)
    EXPECT_NE(registry_.add(lab(i), at(1000)), nullptr) << "it takes nobody's place";
  EXPECT_NE(registry_.find(lab(1)), nullptr);
}

TEST_F(RegistryTest, RemovesOnce) {
  registry_.add(lab(1), at(0));
  EXPECT_TRUE(registry_.remove(lab(1)));
  EXPECT_FALSE(registry_.remove(lab(1)));
}

TEST_F(RegistryTest, NobodyKeepsOthersOutByHoldingManyPlaces) {
  Registry registry({64, 16, std::chrono::seconds(15)});
  for (int i = 0; i < 80; ++i) registry.add(lab(1 + i % 5, 4000 + i), at(0.01 * i));
  ASSERT_EQ(registry.all().size(), 64U);
  for (int host = 100; host < 110; ++host)
    EXPECT_NE(registry.add(lab(host), at(1)), nullptr) << "a computer with one client";
  EXPECT_EQ(registry.all().size(), 64U);
  // Those that were pushed out come back only when they have fewer than others.
  int back = 0;
  for (int i = 0; i < 80; ++i) {
    if (registry.find(lab(1 + i % 5, 4000 + i)) == nullptr)
      back += registry.add(lab(1 + i % 5, 4000 + i), at(1)) != nullptr ? 1 : 0;
  }
  for (int host = 100; host < 110; ++host) EXPECT_NE(registry.find(lab(host)), nullptr);
  EXPECT_LE(back, 5);
}

}  // namespace
}  // namespace fiducap::natnet
