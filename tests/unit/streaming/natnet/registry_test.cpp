#include "streaming/natnet/registry.hpp"

#include <gtest/gtest.h>

namespace fiducap::natnet {
namespace {

Peer lab(int host, int port = 4000) { return {0x0a000000U + static_cast<std::uint32_t>(host), static_cast<std::uint16_t>(port)}; }

class RegistryTest : public testing::Test {
 protected:
  static Instant at(double seconds) { return Instant{} + from_seconds(seconds); }
  [[nodiscard]] std::size_t strangers() const {
    std::size_t n = 0;
    for (const auto& one : registry_.all()) n += one.stranger ? 1 : 0;
    return n;
  }

  Registry registry_{{3, 2, std::chrono::seconds(15)}};
};

TEST_F(RegistryTest, FindsWhoWasAdded) {
  ASSERT_NE(registry_.add(lab(1), false, at(0)), nullptr);
  EXPECT_NE(registry_.find(lab(1)), nullptr);
  EXPECT_EQ(registry_.find(lab(1, 4001)), nullptr) << "another port is another client";
}

TEST_F(RegistryTest, ForgetsAClientAfterItsTimeout) {
  registry_.add(lab(1), false, at(0));
  EXPECT_EQ(registry_.expire(at(15)), 0U);
  EXPECT_EQ(registry_.expire(at(15.001)), 1U);
  EXPECT_EQ(registry_.find(lab(1)), nullptr);
}

TEST_F(RegistryTest, ForgetsAStrangerSoonerAndWithoutCounting) {
  registry_.add(lab(1), true, at(0));
  EXPECT_EQ(registry_.expire(at(3.001)), 0U);
  EXPECT_TRUE(registry_.all().empty());
}

TEST_F(RegistryTest, AStrangerThatIsHeardAgainIsAClient) {
  Subscriber* stranger = registry_.add(lab(1), true, at(0));
  EXPECT_TRUE(registry_.accept(*stranger, at(1)));
  EXPECT_FALSE(registry_.find(lab(1))->stranger);
}

TEST_F(RegistryTest, StrangersPushOutEachOtherButNeverAClient) {
  registry_.add(lab(1), false, at(0));
  for (int i = 0; i < 1000; ++i) registry_.add(lab(100 + i), true, at(0.001 * i));
  EXPECT_EQ(strangers(), static_cast<std::size_t>(Registry::kMaxStrangers));
  EXPECT_NE(registry_.find(lab(1)), nullptr);
  EXPECT_EQ(registry_.find(lab(100)), nullptr);
  EXPECT_NE(registry_.find(lab(1099)), nullptr);
}

TEST_F(RegistryTest, WhenFullOnlyASilentClientGivesWay) {
  for (int i = 1; i <= 3; ++i) registry_.add(lab(i), false, at(0));
  EXPECT_EQ(registry_.add(lab(4), false, at(5)), nullptr);
  registry_.find(lab(1))->heard_at = at(9);
  registry_.find(lab(3))->heard_at = at(9);
  ASSERT_NE(registry_.add(lab(4), false, at(9)), nullptr);
  EXPECT_EQ(registry_.find(lab(2)), nullptr);
  EXPECT_NE(registry_.find(lab(1)), nullptr);
}

TEST_F(RegistryTest, OneAddressHasItsShareOnly) {
  EXPECT_NE(registry_.add(lab(1, 1), false, at(0)), nullptr);
  EXPECT_NE(registry_.add(lab(1, 2), false, at(0)), nullptr);
  EXPECT_EQ(registry_.add(lab(1, 3), false, at(0)), nullptr);
  EXPECT_NE(registry_.add(lab(2, 1), false, at(0)), nullptr);
}

TEST_F(RegistryTest, ThisMachineMayHaveAllPlaces) {
  for (std::uint16_t port = 1; port <= 3; ++port) EXPECT_NE(registry_.add({0x7f000001, port}, false, at(0)), nullptr);
}

TEST_F(RegistryTest, FixedOnesStayWhateverHappens) {
  registry_.add_fixed(lab(1), {3, 1}, at(0));
  EXPECT_FALSE(registry_.remove(lab(1)));
  EXPECT_EQ(registry_.expire(at(1000)), 0U);
  for (int i = 2; i <= 4; ++i) EXPECT_NE(registry_.add(lab(i), false, at(1000)), nullptr) << "it takes nobody's place";
  EXPECT_NE(registry_.find(lab(1)), nullptr);
}

TEST_F(RegistryTest, RemovesOnce) {
  registry_.add(lab(1), false, at(0));
  EXPECT_TRUE(registry_.remove(lab(1)));
  EXPECT_FALSE(registry_.remove(lab(1)));
}

}  // namespace
}  // namespace fiducap::natnet
