#include "streaming/natnet/reflection_guard.hpp"

#include <gtest/gtest.h>

namespace fiducap::natnet {
namespace {

constexpr Peer kSomeone{0x0a000001, 4000};

Instant at(double seconds) { return Instant{} + from_seconds(1000 + seconds); }

TEST(ReflectionGuard, TheSecondDatagramComesFromAnAcquaintance) {
  ReflectionGuard guard(1);
  EXPECT_FALSE(guard.heard(kSomeone, 10, at(0)).known);
  EXPECT_TRUE(guard.heard(kSomeone, 10, at(1)).known);
  EXPECT_FALSE(guard.heard({kSomeone.address, 4001}, 10, at(1)).known) << "another port is somebody else";
}

TEST(ReflectionGuard, AnAcquaintanceIsForgottenAfterSilence) {
  ReflectionGuard guard(1);
  (void)guard.heard(kSomeone, 10, at(0));
  EXPECT_FALSE(guard.heard(kSomeone, 10, at(15.1)).known);
}

TEST(ReflectionGuard, RemembersWhatWasPromised) {
  ReflectionGuard guard(1);
  (void)guard.heard(kSomeone, 10, at(0));
  guard.promise(kSomeone, {4, 1});
  EXPECT_EQ(guard.heard(kSomeone, 10, at(1)).version, (Bitstream{4, 1}));
}

TEST(ReflectionGuard, StrangersGetNoMoreThanTheySentAndAnAllowance) {
  ReflectionGuard guard(1);
  constexpr double kSeconds = 10;
  constexpr int kPerSecond = 10000;
  constexpr std::size_t kQuestion = 273, kAnswer = 283;
  double in = 0, out = 0;
  for (int i = 0; i < kSeconds * kPerSecond; ++i) {
    const Peer forged{0x0b000000U + static_cast<std::uint32_t>(i), static_cast<std::uint16_t>(i * 7 + 1)};
    const Instant now = at(static_cast<double>(i) / kPerSecond);
    const bool known = guard.heard(forged, kQuestion, now).known;
    in += kQuestion;
    if (guard.may_answer(forged, kAnswer, !known, now)) out += kAnswer;
  }
  EXPECT_LE(out, in + ReflectionGuard::kStrangerBurst + kSeconds * ReflectionGuard::kStrangerBytes_s);
  EXPECT_GT(out, 0.5 * in) << "real ones among them must have a chance";
}

TEST(ReflectionGuard, StrangersShareOneAllowanceWhateverTheyAsk) {
  ReflectionGuard guard(1);
  int answered = 0;
  for (int i = 0; i < 1000; ++i) answered += guard.may_send_to_stranger(40000, at(0)) ? 1 : 0;
  EXPECT_EQ(answered, 3);  // 128 kB
  EXPECT_FALSE(guard.may_send_to_stranger(40000, at(0.5)));
  EXPECT_TRUE(guard.may_send_to_stranger(40000, at(2)));
}

TEST(ReflectionGuard, OneAddressCannotHaveEverything) {
  ReflectionGuard guard(1);
  std::size_t bytes = 0;
  for (int i = 0; i < 1000; ++i) bytes += guard.may_answer(kSomeone, 50000, false, at(0)) ? 50000 : 0;
  EXPECT_LE(bytes, ReflectionGuard::kAddressBurst);
  EXPECT_GE(bytes, 64 * 46000U) << "64 clients of one computer fetch the definitions of 1000 bodies";
}

TEST(ReflectionGuard, AClientMeetsItselfAgainInTheMiddleOfAFlood) {
  int met = 0;
  constexpr int kClients = 100;
  constexpr int kForgedBetween = 2500;  // 10 000 a second; a library's second datagram comes after 250 ms
  for (int client = 0; client < kClients; ++client) {
    ReflectionGuard guard(static_cast<std::uint64_t>(client) * 7919);
    (void)guard.heard(kSomeone, 10, at(0));
    for (int i = 0; i < kForgedBetween; ++i) {
      (void)guard.heard({0x0b000000U + static_cast<std::uint32_t>(i), static_cast<std::uint16_t>(i)}, 10, at(0.0001 * i));
    }
    met += guard.heard(kSomeone, 10, at(0.25)).known ? 1 : 0;
  }
  EXPECT_GE(met, kClients * 7 / 10);  // 2500 of 16384 places are overwritten: 86 % expected
}

}  // namespace
}  // namespace fiducap::natnet
