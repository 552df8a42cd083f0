#include "streaming/vicon/session.hpp"

#include <gmock/gmock.h>

#include "client_packets.hpp"
#include "streaming/vicon/vicon.hpp"
#include "support/hex.hpp"

namespace fiducap::vicon {
namespace {

using std::chrono::seconds;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(ViconConfig, ReportsEveryBrokenRule) {
  ViconConfig config;
  EXPECT_TRUE(config.check().empty());
  EXPECT_EQ(config.port, 801);
  EXPECT_EQ(config.when_invalid, WhenInvalid::kFlag);
  config.address = "localhost";
  config.max_clients = 0;
  config.max_clients_per_address = 1000;
  EXPECT_THAT(
      config.check(),
      testing::ElementsAre(Field(&ConfigError::path, "streaming.vicon.address"),
                           Field(&ConfigError::path, "streaming.vicon.max_clients"),
                           Field(&ConfigError::path, "streaming.vicon.max_clients_per_address")));
}

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
  /// Takes the frames `first` to `last`, each of which must be wanted.
  void take(std::uint32_t first, std::uint32_t last) {
    for (std::uint32_t id = first; id <= last; ++id) {
      ASSERT_TRUE(connection_.wants(id)) << id;
      connection_.sent(id, {});
    }
  }

  Instant now_{instant_from_ns(7)};
  ProfileTable profiles_;
  Connection connection_;
  std::vector<std::byte> answers_;
};

TEST_F(ViconConnectionTest, WantsNothingUntilItIsGreetedAndItsTypesAreKnown) {
  greet();
  receive(client::request_frame(true));
  EXPECT_FALSE(connection_.wants(1));
  receive(client::types(client::kSegments));
  EXPECT_TRUE(connection_.wants(1)) << "the earlier request is kept";
  Connection early(profiles_, now_);
  ASSERT_TRUE(early.receive(client::types(client::kSegments), now_, answers_));
  ASSERT_TRUE(early.receive(client::request_frame(true), now_, answers_));
  EXPECT_FALSE(early.wants(1));
  (void)early.greeting();
  EXPECT_TRUE(early.wants(1));
}

TEST_F(ViconConnectionTest, PullWantsOneFrameAndNeverTheSameTwice) {
  open();
  EXPECT_FALSE(connection_.wants(1));
  receive(client::request_frame(false));
  take(1, 1);
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

TEST_F(ViconConnectionTest, PushWantsEveryFrameAndPrefetchTheNextN) {
  open();
  receive(client::request_frame(true));
  take(1, 49);
  receive(client::request_frame(false));
  take(50, 50);  // the request that stops pushing equals a pull
  EXPECT_FALSE(connection_.wants(51));
  receive(client::request_next(3));
  take(51, 53);
  EXPECT_FALSE(connection_.wants(54));
}

TEST_F(ViconConnectionTest, WantsStaticsOnceAndAfterEachChange) {
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

TEST_F(ViconConnectionTest, ClientsWithEqualRequestsShareAProfile) {
  open();
  Connection other(profiles_, now_);
  Connection filtering(profiles_, now_);
  ASSERT_TRUE(other.receive(client::types(client::kSegments), now_, answers_));
  ASSERT_TRUE(filtering.receive(client::types(client::kSegments), now_, answers_));
  ASSERT_TRUE(filtering.receive(client::filter({{9, {1}}}), now_, answers_));
  EXPECT_EQ(connection_.profile(), other.profile());
  EXPECT_NE(connection_.profile(), filtering.profile());
}

TEST_F(ViconConnectionTest, AnswersPingsWithTheirIdAfterTheGreeting) {
  receive(client::ping(5));
  EXPECT_THAT(answers_, IsEmpty());
  greet();
  receive(client::ping(0x11223344));
  EXPECT_EQ(to_hex(answers_), "01002b1a100000002a000000080000004433221100000000");
}

TEST_F(ViconConnectionTest, IgnoresUnknownObjects) {
  open();
  receive(client::packet(35, client::Bytes(40)));      // haptics
  receive(client::packet(100003, {}));                 // keep-alive
  receive(client::packet(100005, client::Bytes(10)));  // multicast
  receive(client::packet(0xffffffff, client::Bytes(3)));
  receive(client::packet(77777, client::Bytes(65000)));
  receive(from_hex("01002b1a 00000000"));  // an empty packet
  EXPECT_THAT(answers_, IsEmpty());
  EXPECT_FALSE(connection_.wants(1));
}

TEST_F(ViconConnectionTest, ReadsSeveralObjectsPerPacketAndPacketsCutAnywhere) {
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

TEST_F(ViconConnectionTest, EndsOnGarbageAndInvalidLengths) {
  for (const char* text :
       {"474554202f" /* GET / */, "01002b1a ffffffff",
        "01002b1a 0c000000 a1860100 04000000 ffffff7f", "01002b1a 08000000 a1860100 ffffffff"}) {
    Connection target(profiles_, now_);
    EXPECT_FALSE(target.receive(from_hex(text), now_, answers_)) << text;
  }
}

TEST_F(ViconConnectionTest, IsOverdueOnlyUntilItsTypesAreKnown) {
  greet();
  EXPECT_FALSE(connection_.overdue(now_ + seconds(10)));
  receive(client::request_frame(true));
  EXPECT_THAT(connection_.overdue(now_ + seconds(11)).value_or(""),
              HasSubstr("did not request data"));
  receive(client::types(client::kSegments));
  EXPECT_FALSE(connection_.overdue(now_ + seconds(100'000)));
}

TEST_F(ViconConnectionTest, IsOverdueWhenAPacketArrivesByteByByte) {
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

TEST_F(ViconConnectionTest, SummaryDescribesTheSubscription) {
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

}  // namespace
}  // namespace fiducap::vicon
