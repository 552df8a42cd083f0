#include "streaming/natnet/quiet_connects.hpp"

#include <gtest/gtest.h>

namespace fiducap::natnet {
namespace {

constexpr net::Peer kFirst{0x0a000001, 1000};
constexpr net::Peer kSecond{0x0a000002, 1000};
constexpr Instant kStart = instant_from_ns(1'000'000'000);
constexpr Instant kLate = kStart + QuietConnects::kPatience;

TEST(QuietConnects, NamesWhoConnectedAndWasNotHeardOfAgainOnce) {
  QuietConnects quiet;
  quiet.asked(kFirst, kStart);
  quiet.asked(kSecond, kStart);
  EXPECT_EQ(quiet.next(kLate - Duration(1)), std::nullopt);
  quiet.heard(kFirst);
  EXPECT_EQ(quiet.next(kLate), kSecond);
  EXPECT_EQ(quiet.next(kLate), std::nullopt);
}

TEST(QuietConnects, AskingAgainIsAsking) {
  QuietConnects quiet;
  quiet.asked(kFirst, kStart);
  quiet.asked(kFirst, kLate);
  EXPECT_EQ(quiet.next(kLate), std::nullopt);
  EXPECT_EQ(quiet.next(kLate + QuietConnects::kPatience), kFirst);
}

TEST(QuietConnects, RemembersOnlyTheNewest) {
  QuietConnects quiet;
  constexpr auto kMore = static_cast<std::uint16_t>(QuietConnects::kMost + 1);
  for (std::uint16_t port = 1; port <= kMore; ++port) quiet.asked({0x0a000001, port}, kStart);
  EXPECT_EQ(quiet.next(kLate), (net::Peer{0x0a000001, 2}));
}

}  // namespace
}  // namespace fiducap::natnet
