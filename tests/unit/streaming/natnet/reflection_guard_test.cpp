#include "streaming/natnet/reflection_guard.hpp"

#include <gtest/gtest.h>

namespace fiducap::natnet {
namespace {

constexpr Peer kSomeone{0x0a000001, 4000};
constexpr Peer kStranger{0xc0a80001, 4000};

Instant at(double seconds) { return Instant{} + from_seconds(1000 + seconds); }

ReflectionGuard guard_of(std::uint64_t key = 1) {
  const auto attached = [] {
    return std::vector{*net::parse_network("10.0.0.0/8"), *net::parse_network("127.0.0.0/8")};
  };
  return {key, net::TrustedNetworks({}, attached)};
}

TEST(ReflectionGuard, TrustsNetworksAndNobodyElse) {
  ReflectionGuard guard = guard_of();
  EXPECT_TRUE(guard.heard(kSomeone, 10, at(0)).trusted);
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(guard.heard(kStranger, 10, at(0.1 * i)).trusted);
}

TEST(ReflectionGuard, RemembersWhatWasPromisedUntilSilence) {
  ReflectionGuard guard = guard_of();
  (void)guard.heard(kSomeone, 10, at(0));
  guard.promise(kSomeone, {4, 1});
  EXPECT_EQ(guard.heard(kSomeone, 10, at(1)).version, (Bitstream{4, 1}));
  EXPECT_EQ(guard.heard({kSomeone.address, 4001}, 10, at(1)).version, Bitstream{})
      << "another port is somebody else";
  EXPECT_EQ(guard.heard(kSomeone, 10, at(16.1)).version, Bitstream{});
}

TEST(ReflectionGuard, AStrangerGetsThreeTimesItsBytesHoweverItAsks) {
  ReflectionGuard guard = guard_of();
  std::size_t in = 0, out = 0;
  for (int i = 0; i < 100000; ++i) {
    const std::size_t question = static_cast<std::size_t>(4 + i % 300);
    const std::size_t answer = static_cast<std::size_t>(100 + (i * 37) % 40000);
    (void)guard.heard(kStranger, question, at(0.001 * i));
    in += question;
    if (guard.may_answer(kStranger, answer, false, at(0.001 * i))) out += answer;
    ASSERT_LE(out, 3 * in);
  }
  EXPECT_GT(out, in) << "short answers go";
}

TEST(ReflectionGuard, OneAddressCannotHaveEverything) {
  ReflectionGuard guard = guard_of();
  std::size_t bytes = 0;
  for (int i = 0; i < 1000; ++i)
    bytes += guard.may_answer(kSomeone, 50000, true, at(0)) ? 50000 : 0;
  EXPECT_LE(bytes, ReflectionGuard::kAddressBurst);
  EXPECT_GE(bytes, 16 * 50000U)
      << "16 clients of one computer fetch the definitions of 1000 bodies";
}

TEST(ReflectionGuard, NobodyOutsideCanAskInTheNameOfThisMachine) {
  ReflectionGuard guard = guard_of();
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(guard.may_answer({0x7f000001, 9}, 50000, true, at(0)));
}

TEST(ReflectionGuard, SaysARefusalOnceInAWhile) {
  ReflectionGuard guard = guard_of();
  EXPECT_TRUE(guard.may_complain(kStranger, at(0)));
  EXPECT_FALSE(guard.may_complain(kStranger, at(500)));
  EXPECT_TRUE(guard.may_complain(kStranger, at(601)));
}

}  // namespace
}  // namespace fiducap::natnet
