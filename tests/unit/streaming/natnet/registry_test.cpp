#include <gtest/gtest.h>

#include "streaming/natnet/registry.hpp"

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

TEST_F(RegistryTest, FindsAClientByAddressAndPortUntilItsTimeout) {
  ASSERT_NE(registry_.add(lab(1), at(0)), nullptr);
  EXPECT_NE(registry_.find(lab(1)), nullptr);
  EXPECT_EQ(registry_.find(lab(1, 4001)), nullptr);
  EXPECT_EQ(registry_.expire(at(15)), 0U);
  EXPECT_EQ(registry_.expire(at(15.001)), 1U);
  EXPECT_EQ(registry_.find(lab(1)), nullptr);
  registry_.add(lab(1), at(0));
  EXPECT_TRUE(registry_.remove(lab(1)));
  EXPECT_FALSE(registry_.remove(lab(1)));
}

TEST_F(RegistryTest, ReplacesOnlyASilentClientWhenFull) {
  for (int i = 1; i <= 3; ++i) registry_.add(lab(i), at(0));
  EXPECT_EQ(registry_.add(lab(4), at(5)), nullptr);
  registry_.find(lab(1))->heard_at = at(9);
  registry_.find(lab(3))->heard_at = at(9);
  ASSERT_NE(registry_.add(lab(4), at(9)), nullptr);
  EXPECT_EQ(registry_.find(lab(2)), nullptr);
  EXPECT_NE(registry_.find(lab(1)), nullptr);
}

TEST_F(RegistryTest, LimitsTheClientsOfAnAddressExceptThisMachine) {
  EXPECT_NE(registry_.add(lab(1, 1), at(0)), nullptr);
  EXPECT_NE(registry_.add(lab(1, 2), at(0)), nullptr);
  EXPECT_EQ(registry_.add(lab(1, 3), at(0)), nullptr);
  EXPECT_NE(registry_.add(lab(2, 1), at(0)), nullptr);
  Registry local({3, 2, std::chrono::seconds(15)});
  for (std::uint16_t port = 1; port <= 3; ++port)
    EXPECT_NE(local.add({0x7f000001, port}, at(0)), nullptr);
}

TEST_F(RegistryTest, KeepsFixedClientsBesideTheOthers) {
  registry_.add_fixed(lab(1), {3, 1}, at(0));
  EXPECT_FALSE(registry_.remove(lab(1)));
  EXPECT_EQ(registry_.expire(at(1000)), 0U);
  for (int i = 2; i <= 4; ++i) EXPECT_NE(registry_.add(lab(i), at(1000)), nullptr);
  EXPECT_NE(registry_.find(lab(1)), nullptr);
}

TEST_F(RegistryTest, AddressesWithManyClientsBlockNoOther) {
  Registry registry({64, 16, std::chrono::seconds(15)});
  for (int i = 0; i < 80; ++i) registry.add(lab(1 + i % 5, 4000 + i), at(0.01 * i));
  ASSERT_EQ(registry.all().size(), 64U);
  for (int host = 100; host < 110; ++host)
    EXPECT_NE(registry.add(lab(host), at(1)), nullptr) << "a computer with one client";
  EXPECT_EQ(registry.all().size(), 64U);
  // A replaced client returns only when its address has fewer than others.
  int back = 0;
  for (int i = 0; i < 80; ++i) {
    if (registry.find(lab(1 + i % 5, 4000 + i)) == nullptr)
      back += registry.add(lab(1 + i % 5, 4000 + i), at(1)) != nullptr ? 1 : 0;
  }
  for (int host = 100; host < 110; ++host) EXPECT_NE(registry.find(lab(host)), nullptr);
  EXPECT_LE(back, 5);
}

TEST(Selection, ContainsAllBodiesOrTheSubscribedOnes) {
  Selection selection;
  EXPECT_TRUE(selection.is_everything());
  EXPECT_TRUE(selection.has(1));
  selection.only_subscribed();
  EXPECT_FALSE(selection.has(1));
  selection.body(2, true);
  EXPECT_TRUE(selection.has(2));
  EXPECT_FALSE(selection.has(1));
  EXPECT_FALSE(selection.is_everything());
  const Selection once = selection;
  for (int i = 0; i < 1000; ++i) selection.body(2, true);
  EXPECT_EQ(selection, once) << "each body is stored once";
  selection.clear();
  EXPECT_EQ(selection, Selection());
}

constexpr net::Peer kFirst{0x0a000001, 1000};
constexpr net::Peer kSecond{0x0a000002, 1000};
constexpr Instant kStart = instant_from_ns(1'000'000'000);
constexpr Instant kLate = kStart + QuietConnects::kSilence;

TEST(QuietConnects, ReportsASilentClientOnceAfterItsLastConnect) {
  QuietConnects quiet;
  quiet.connected(kFirst, kStart);
  quiet.connected(kSecond, kStart);
  EXPECT_EQ(quiet.next(kLate - Duration(1)), std::nullopt);
  quiet.heard(kFirst);
  EXPECT_EQ(quiet.next(kLate), kSecond);
  EXPECT_EQ(quiet.next(kLate), std::nullopt);
  quiet.connected(kFirst, kStart);
  quiet.connected(kFirst, kLate);
  EXPECT_EQ(quiet.next(kLate), std::nullopt);
  EXPECT_EQ(quiet.next(kLate + QuietConnects::kSilence), kFirst);
}

TEST(QuietConnects, KeepsTheNewestOnly) {
  QuietConnects quiet;
  constexpr auto kMore = static_cast<std::uint16_t>(QuietConnects::kMost + 1);
  for (std::uint16_t port = 1; port <= kMore; ++port) quiet.connected({0x0a000001, port}, kStart);
  EXPECT_EQ(quiet.next(kLate), (net::Peer{0x0a000001, 2}));
}

constexpr Peer kSomeone{0x0a000001, 4000};
constexpr Peer kStranger{0xc0a80001, 4000};

Instant at(double seconds) { return Instant{} + from_seconds(1000 + seconds); }

class ReflectionGuardTest : public testing::Test {
 protected:
  static std::vector<net::Network> attached() {
    return {*net::parse_network("10.0.0.0/8"), *net::parse_network("127.0.0.0/8")};
  }
  ReflectionGuard guard_{1, net::TrustedNetworks({}, attached)};
};

TEST_F(ReflectionGuardTest, TrustsAttachedNetworksOnly) {
  EXPECT_TRUE(guard_.heard(kSomeone, 10, at(0)).trusted);
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(guard_.heard(kStranger, 10, at(0.1 * i)).trusted);
}

TEST_F(ReflectionGuardTest, KeepsTheVersionOfAClientUntilItIsSilent) {
  (void)guard_.heard(kSomeone, 10, at(0));
  guard_.set_version(kSomeone, {4, 1});
  EXPECT_EQ(guard_.heard(kSomeone, 10, at(1)).version, (Bitstream{4, 1}));
  EXPECT_EQ(guard_.heard({kSomeone.address, 4001}, 10, at(1)).version, Bitstream{})
      << "another port is another client";
  EXPECT_EQ(guard_.heard(kSomeone, 10, at(16.1)).version, Bitstream{});
}

TEST_F(ReflectionGuardTest, SendsAStrangerAtMostThreeTimesItsBytes) {
  std::size_t in = 0, out = 0;
  for (int i = 0; i < 100000; ++i) {
    const std::size_t question = static_cast<std::size_t>(4 + i % 300);
    const std::size_t answer = static_cast<std::size_t>(100 + (i * 37) % 40000);
    (void)guard_.heard(kStranger, question, at(0.001 * i));
    in += question;
    if (guard_.may_answer(kStranger, answer, false, at(0.001 * i))) out += answer;
    ASSERT_LE(out, 3 * in);
  }
  EXPECT_GT(out, in) << "short answers are sent";
}

TEST_F(ReflectionGuardTest, LimitsTheBytesOfAnAddressExceptThisMachine) {
  std::size_t bytes = 0;
  for (int i = 0; i < 1000; ++i)
    bytes += guard_.may_answer(kSomeone, 50000, true, at(0)) ? 50000 : 0;
  EXPECT_LE(bytes, ReflectionGuard::kAddressBurst);
  EXPECT_GE(bytes, 16 * 50000U)
      << "16 clients of one computer fetch the definitions of 1000 bodies";
  for (int i = 0; i < 1000; ++i)
    ASSERT_TRUE(guard_.may_answer({0x7f000001, 9}, 50000, true, at(0)));
}

TEST_F(ReflectionGuardTest, LimitsWarningsOfRefusals) {
  EXPECT_TRUE(guard_.may_warn(kStranger, at(0)));
  EXPECT_FALSE(guard_.may_warn(kStranger, at(500)));
  EXPECT_TRUE(guard_.may_warn(kStranger, at(601)));
}

}  // namespace
}  // namespace fiducap::natnet
