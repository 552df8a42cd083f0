#include <gmock/gmock.h>

#include <random>

#include "client_packets.hpp"
#include "streaming/vicon/session.hpp"
#include "support/hex.hpp"

namespace fiducap::vicon {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;
using testing::IsEmpty;

class ViconConnectionTest : public testing::Test {
 protected:
  ViconConnectionTest() : connection_(profiles_, now_) {}

  void greet() { (void)connection_.greeting(); }
  void open() {
    greet();
    receive(client::types(client::kSegments));
  }
  void receive(const client::Bytes& bytes) {
    const auto result = connection_.receive(bytes, now_, answers_);
    EXPECT_TRUE(result) << result.error().text();
  }

  Instant now_{instant_from_ns(7)};
  ProfileTable profiles_;
  Connection connection_;
  std::vector<std::byte> answers_;
};

TEST_F(ViconConnectionTest, WantsNothingUntilItsTypesAreKnown) {
  greet();
  receive(client::request_frame(true));
  EXPECT_FALSE(connection_.wants(1));
  receive(client::types(client::kSegments));
  EXPECT_TRUE(connection_.wants(1)) << "the request that came first is remembered";
}

TEST_F(ViconConnectionTest, WantsNothingBeforeItWasGreeted) {
  receive(client::types(client::kSegments));
  receive(client::request_frame(true));
  EXPECT_FALSE(connection_.wants(1));
  greet();
  EXPECT_TRUE(connection_.wants(1));
}

TEST_F(ViconConnectionTest, PullWantsOneFrameAndNeverTheSameTwice) {
  open();
  EXPECT_FALSE(connection_.wants(1));
  receive(client::request_frame(false));
  ASSERT_TRUE(connection_.wants(1));
  connection_.sent(1, {});
  EXPECT_FALSE(connection_.wants(2));
  receive(client::request_frame(false));
  EXPECT_FALSE(connection_.wants(1));
  EXPECT_TRUE(connection_.wants(2));
}

TEST_F(ViconConnectionTest, RepeatedRequestsDoNotAddUp) {
  open();
  for (int i = 0; i < 5; ++i) receive(client::request_frame(false));
  connection_.sent(1, {});
  EXPECT_FALSE(connection_.wants(2));
  for (int i = 0; i < 5; ++i) receive(client::request_next(1));
  connection_.sent(2, {});
  EXPECT_FALSE(connection_.wants(3));
}

TEST_F(ViconConnectionTest, PrefetchWantsTheNextNFrames) {
  open();
  receive(client::request_next(3));
  for (std::uint32_t id = 1; id <= 3; ++id) {
    ASSERT_TRUE(connection_.wants(id));
    connection_.sent(id, {});
  }
  EXPECT_FALSE(connection_.wants(4));
}

TEST_F(ViconConnectionTest, PushWantsEveryFrameUntilItIsStopped) {
  open();
  receive(client::request_frame(true));
  for (std::uint32_t id = 1; id < 50; ++id) {
    ASSERT_TRUE(connection_.wants(id));
    connection_.sent(id, {});
  }
  receive(client::request_frame(false));
  ASSERT_TRUE(connection_.wants(50)) << "the request that stops pushing equals a pull";
  connection_.sent(50, {});
  EXPECT_FALSE(connection_.wants(51));
}

TEST_F(ViconConnectionTest, StaticsAreWantedOnceAndAgainAfterAChange) {
  open();
  EXPECT_TRUE(connection_.wants_statics(1));
  connection_.sent(1, 1);
  EXPECT_FALSE(connection_.wants_statics(1));
  EXPECT_TRUE(connection_.wants_statics(2)) << "the subjects changed";
  connection_.sent(2, 2);
  receive(client::types(client::kLight));
  EXPECT_TRUE(connection_.wants_statics(2)) << "other types";
  connection_.sent(3, 2);
  receive(client::filter({{9, {1}}}));
  EXPECT_TRUE(connection_.wants_statics(2)) << "a filter";
  connection_.sent(4, {});
  EXPECT_TRUE(connection_.wants_statics(2)) << "a frame without them does not count";
}

TEST_F(ViconConnectionTest, TypesReplaceEachOtherAndKeepTheFilter) {
  greet();
  receive(client::filter({{9, {2}}, {15, {4}}}));
  receive(client::types({2, 9, 12345}));
  EXPECT_TRUE(connection_.profile()->types.has(Type::kGlobalSegments));
  EXPECT_EQ(connection_.profile()->types.size(), 2u);
  EXPECT_EQ(connection_.profile()->filter.size(), 1u);
  receive(client::types({2, 901}));
  EXPECT_FALSE(connection_.profile()->types.has(Type::kGlobalSegments));
  EXPECT_EQ(connection_.profile()->filter.size(), 1u);
  receive(client::filter({}));
  EXPECT_THAT(connection_.profile()->filter, IsEmpty());
}

TEST_F(ViconConnectionTest, ClientsWithTheSameWishesShareAProfile) {
  open();
  Connection other(profiles_, now_);
  Connection filtering(profiles_, now_);
  ASSERT_TRUE(other.receive(client::types(client::kSegments), now_, answers_));
  ASSERT_TRUE(filtering.receive(client::types(client::kSegments), now_, answers_));
  ASSERT_TRUE(filtering.receive(client::filter({{9, {1}}}), now_, answers_));
  EXPECT_EQ(connection_.profile(), other.profile());
  EXPECT_NE(connection_.profile(), filtering.profile());
}

TEST_F(ViconConnectionTest, AnswersPingsWithTheirIdButNotBeforeTheGreeting) {
  receive(client::ping(5));
  EXPECT_THAT(answers_, IsEmpty());
  greet();
  receive(client::ping(0x11223344));
  EXPECT_EQ(to_hex(answers_), "01002b1a100000002a000000080000004433221100000000");
}

TEST_F(ViconConnectionTest, IgnoresWhatItDoesNotKnow) {
  open();
  receive(client::packet(35, client::Bytes(40)));      // haptics
  receive(client::packet(100003, {}));                 // keep-alive
  receive(client::packet(100005, client::Bytes(10)));  // multicast
  receive(client::packet(0xffffffff, client::Bytes(3)));
  receive(from_hex("01002b1a 00000000"));  // an empty packet
  EXPECT_THAT(answers_, IsEmpty());
  EXPECT_FALSE(connection_.wants(1));
}

TEST_F(ViconConnectionTest, TakesSeveralObjectsPerPacketAndPacketsCutAnywhere) {
  greet();
  client::Bytes all = from_hex(
      "01002b1a 25000000  a1860100 0c000000 02000000 09000000 a4860100  a2860100 01000000 01");
  all[4] = static_cast<std::byte>(all.size() - 8);
  const client::Bytes ping = client::ping(9);
  all.insert(all.end(), ping.begin(), ping.end());
  for (const std::byte one : all) receive({one});
  EXPECT_TRUE(connection_.wants(1));
  EXPECT_EQ(answers_.size(), 24u);
}

TEST_F(ViconConnectionTest, EndsOnGarbageAndAbsurdLengths) {
  EXPECT_FALSE(connection_.receive(from_hex("474554202f"), now_, answers_));  // "GET /"
  Connection absurd(profiles_, now_);
  EXPECT_FALSE(absurd.receive(from_hex("01002b1a ffffffff"), now_, answers_));
  Connection lying(profiles_, now_);
  EXPECT_FALSE(
      lying.receive(from_hex("01002b1a 0c000000 a1860100 04000000 ffffff7f"), now_, answers_));
  Connection overlong(profiles_, now_);
  EXPECT_FALSE(overlong.receive(from_hex("01002b1a 08000000 a1860100 ffffffff"), now_, answers_));
}

TEST_F(ViconConnectionTest, IsOverdueWhenItNeverSaysWhatItWants) {
  greet();
  EXPECT_FALSE(connection_.overdue(now_ + seconds(10)));
  receive(client::request_frame(true));
  EXPECT_THAT(connection_.overdue(now_ + seconds(11)).value_or(""),
              HasSubstr("did not request data"));
}

TEST_F(ViconConnectionTest, MayBeSilentForeverOnceItIsOpen) {
  open();
  EXPECT_FALSE(connection_.overdue(now_ + seconds(100'000)));
}

TEST_F(ViconConnectionTest, IsOverdueWhenAPacketDripsInByteByByte) {
  open();
  const client::Bytes ping = client::ping(9);
  const Instant begin = now_ += seconds(60);
  std::optional<std::string> why;
  for (std::size_t i = 0; !why && i + 1 < ping.size(); ++i) {
    receive({ping[i]});
    now_ += seconds(1);
    why = connection_.overdue(now_);
  }
  EXPECT_THAT(why.value_or(""), HasSubstr("part of a packet"));
  EXPECT_LE(now_ - begin, seconds(12));
}

TEST_F(ViconConnectionTest, SaysInWordsWhatItReceives) {
  greet();
  EXPECT_EQ(connection_.summary(), "silent");
  receive(client::types(client::kSegments));
  receive(client::request_frame(true));
  EXPECT_EQ(connection_.summary(), "push, segments");
  receive(client::types(client::kLight));
  receive(client::filter({{901, {1, 4}}}));
  receive(client::request_next(1));
  EXPECT_EQ(connection_.summary(), "prefetch, lightweight segments, 2 subjects only");
}

TEST_F(ViconConnectionTest, SurvivesRandomBytesBehindAValidTag) {
  std::mt19937 random(29);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 3000; ++i) {
    Connection target(profiles_, now_);
    (void)target.greeting();
    const std::uint32_t kinds[] = {42, 100001, 100002, 100007, 100008};
    client::Bytes noise(static_cast<std::size_t>(byte(random)) / 4);
    for (auto& b : noise) b = static_cast<std::byte>(byte(random) < 128 ? 0 : byte(random));
    (void)target.receive(client::packet(kinds[i % 5], noise), now_, answers_);
    (void)target.wants(1);
  }
}

}  // namespace
}  // namespace fiducap::vicon
