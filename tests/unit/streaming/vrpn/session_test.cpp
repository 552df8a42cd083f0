#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "connection_fixture.hpp"
#include "streaming/vrpn/codec.hpp"
#include "streaming/vrpn/session.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vrpn {
namespace {

using testing::ElementsAre;

SceneModel model(std::uint64_t generation, const std::vector<std::string>& names) {
  SceneModel made{generation, {}};
  for (const auto& name : names)
    made.bodies.push_back({static_cast<int>(made.bodies.size()) + 1, name});
  return made;
}

TEST(VrpnSenderTable, PutsControlFirstAndBodiesBehindItWithoutHoles) {
  SenderTable table;
  EXPECT_TRUE(table.update(model(1, {"arm", "drone"})).empty());
  EXPECT_THAT(table.names(), ElementsAre("VRPN Control", "arm", "drone"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(1, 2));
  EXPECT_EQ(table.list_bodies(), "arm, drone");
}

TEST(VrpnSenderTable, NeverGivesAnIdToAnotherName) {
  SenderTable table;
  table.update(model(1, {"arm", "drone"}));
  table.update(model(2, {"rover", "drone"}));
  EXPECT_THAT(table.names(), ElementsAre("VRPN Control", "arm", "drone", "rover"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(3, 2));
  EXPECT_FALSE(table.find_body("arm"));
  EXPECT_EQ(table.find_body("rover"), 3);
  table.update(model(3, {"arm"}));
  EXPECT_EQ(table.find_body("arm"), 1);
}

TEST(VrpnSenderTable, ReadsAGenerationOnce) {
  SenderTable table;
  table.update(model(1, {"arm"}));
  table.update(model(1, {"other"}));
  EXPECT_FALSE(table.find_body("other"));
}

TEST(VrpnSenderTable, ServesNeitherBrokenNorDoubledNames) {
  SenderTable table;
  const auto refused =
      table.update(model(1, {"arm", "a@b", "arm", std::string(96, 'x'), "VRPN Control"}));
  EXPECT_THAT(refused, ElementsAre("a@b", "arm", std::string(96, 'x'), "VRPN Control"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(1, -1, -1, -1, -1));
  EXPECT_FALSE(table.find_body("VRPN Control"));
}

TEST(VrpnSenderTable, ShowsAnAliasAndKnowsWhoseItIs) {
  SenderTable table(NameAliases{{"drone", "cf7"}, {"arm", "a@b"}});
  EXPECT_THAT(table.update(model(1, {"arm", "drone"})), ElementsAre("a@b"))
      << "an alias obeys the rules, too";
  EXPECT_FALSE(table.find_body("drone"));
  ASSERT_TRUE(table.find_body("cf7"));
  EXPECT_EQ(table.own_name_of(*table.find_body("cf7")), "drone");
}

TEST(VrpnSenderTable, MatchesNamesByteByByte) {
  SenderTable table;
  table.update(model(1, {"Arm"}));
  EXPECT_FALSE(table.find_body("arm"));
  EXPECT_FALSE(table.find_body("Arm "));
}

TEST(VrpnSenderTable, StopsAtTheLastIdThatClientsTake) {
  SenderTable table;
  std::vector<std::string> names;
  for (int i = 0; i < 2100; ++i) names.push_back("b" + std::to_string(i));
  EXPECT_EQ(table.update(model(1, names)).size(), 101u);  // 2000 ids, one is VRPN Control's
  EXPECT_EQ(table.of_bodies()[1998], 1999);
  EXPECT_EQ(table.of_bodies()[1999], -1);
}

TEST(VrpnBodyName, IsCheckedWithPathAndRule) {
  EXPECT_TRUE(check_body_name("bodies[0].name", std::string(95, 'x')).empty());
  EXPECT_TRUE(check_body_name("bodies[0].name", "Körper 1/a:b").empty());
  const auto errors = check_body_name("bodies[2].name", "a@\n");
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_EQ(errors[0].path, "bodies[2].name");
  EXPECT_EQ(check_body_name("x", "").size(), 1u);
  EXPECT_EQ(check_body_name("x", std::string(96, 'x')).size(), 1u);
  EXPECT_EQ(check_body_name("x", "VRPN Control").size(), 1u);
}

class BodyWatchTest : public testing::Test {
 protected:
  /// One frame 10 ms after the last. @return the texts, with their sender.
  std::vector<std::pair<std::int32_t, TextMessage>> observe(bool a_valid, bool b_valid = true) {
    auto frame = make_scene_frame({"a", "b"}, ++number_);
    frame->bodies[0].valid = a_valid;
    frame->bodies[1].valid = b_valid;
    bytes_.emplace_back();
    watch_.observe(*frame, senders_, bytes_.back());
    std::vector<std::pair<std::int32_t, TextMessage>> texts;
    for (std::span<const std::byte> rest(bytes_.back()); !rest.empty();) {
      const auto message = decode_message(rest);
      EXPECT_TRUE(message);
      EXPECT_EQ(message->header.type, 15);
      texts.emplace_back(message->header.sender, *decode_text(message->payload));
      rest = rest.subspan(message->size);
    }
    return texts;
  }

  BodyWatch watch_;
  std::vector<std::int32_t> senders_{1, 2};
  std::uint64_t number_{0};
  std::vector<std::vector<std::byte>> bytes_;  // texts point into them
};

TEST_F(BodyWatchTest, WarnsOnceWhenABodyIsLost) {
  EXPECT_TRUE(observe(true).empty());
  const auto texts = observe(false);
  ASSERT_EQ(texts.size(), 1u);
  EXPECT_EQ(texts[0].first, 1);
  EXPECT_EQ(texts[0].second.severity, Severity::kWarning);
  for (int i = 0; i < 500; ++i) EXPECT_TRUE(observe(false).empty());
}

TEST_F(BodyWatchTest, SaysWhenItIsBackWithoutWarning) {
  observe(true);
  observe(false);
  number_ += 100;  // a second later
  const auto texts = observe(true);
  ASSERT_EQ(texts.size(), 1u);
  EXPECT_EQ(texts[0].second.severity, Severity::kNormal);
}

TEST_F(BodyWatchTest, SaysNothingOfABodyThatWasNeverSeen) {
  for (int i = 0; i < 300; ++i) EXPECT_TRUE(observe(false).empty());
}

TEST_F(BodyWatchTest, SaysAtMostOneThingPerSecondAndBody) {
  observe(true);
  std::size_t texts = 0;
  for (int i = 0; i < 500; ++i) texts += observe(i % 2 == 0).size();  // 5 s of flicker
  EXPECT_GE(texts, 3u);
  EXPECT_LE(texts, 6u);
}

TEST_F(BodyWatchTest, IgnoresBodiesThatAreNotServed) {
  senders_ = {-1, 2};
  observe(true);
  EXPECT_TRUE(observe(false).empty());
}

using testing::HasSubstr;

TEST_F(VrpnConnectionTest, GreetsWithoutWaiting) {
  config_.minor_version = 38;
  EXPECT_EQ(make().greeting(), golden("cookie"));
}

TEST_F(VrpnConnectionTest, DescribesSendersAndTypesInOrderAfterTheCookie) {
  auto connection = make();
  EXPECT_FALSE(connection.open());
  const auto sent = feed(connection, golden("cookie"));
  EXPECT_TRUE(connection.open());
  ASSERT_EQ(sent.size(), 3u + 18u);
  const std::vector<std::string> names{"VRPN Control", "drone", "arm"};
  for (std::size_t i = 0; i < sent.size(); ++i) {
    const bool sender = i < 3;
    EXPECT_EQ(sent[i].header.type, sender ? -1 : -2);
    EXPECT_EQ(sent[i].header.sender, static_cast<std::int32_t>(sender ? i : i - 3));
    EXPECT_EQ(sent[i].name(), sender ? names[i] : std::string(kTypeNames[i - 3]));
    EXPECT_EQ(sent[i].header.utc_ns, kNow_ns);
  }
}

TEST_F(VrpnConnectionTest, NeverAnswersADescription) {
  auto connection = make();
  const auto sent = feed(connection, hello());
  EXPECT_EQ(sent.size(), 21u);  // its own, nothing back for the client's
}

TEST_F(VrpnConnectionTest, AnswersAPingWithItsOwnNumbers) {
  auto connection = make();
  feed(connection, hello());
  const auto sent = feed(connection, empty(kClientArm, Type::kPing));
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].header, (Header{kNow_ns, 2, 17, 0}));
  EXPECT_TRUE(sent[0].payload.empty());
}

TEST_F(VrpnConnectionTest, AnswersTheRequestsWithIdentityAndTheWorkspace) {
  auto connection = make();
  feed(connection, hello());
  Bytes asked = empty(kClientArm, Type::kRequestToRoom);
  asked += empty(kClientArm, Type::kRequestUnitToSensor);
  asked += empty(kClientArm, Type::kRequestWorkspace);
  const auto sent = feed(connection, asked);
  ASSERT_EQ(sent.size(), 3u);
  for (const auto& message : sent) EXPECT_EQ(message.header.sender, 2);
  Bytes identity;
  BigEndianWriter(identity).f64(0).f64(0).f64(0).f64(0).f64(0).f64(0).f64(1);
  Bytes with_sensor;
  BigEndianWriter(with_sensor).i32(0).i32(0).bytes(identity);
  Bytes box;
  BigEndianWriter(box).f64(-10).f64(-10).f64(0).f64(10).f64(10).f64(5);
  EXPECT_EQ(sent[0].header.type, 7);
  EXPECT_EQ(sent[0].payload, identity);
  EXPECT_EQ(sent[1].header.type, 8);
  EXPECT_EQ(sent[1].payload, with_sensor);
  EXPECT_EQ(sent[2].header.type, 11);
  EXPECT_EQ(sent[2].payload, box);
}

TEST_F(VrpnConnectionTest, TheWorkspaceTurnsWithTheAxes) {
  config_.up = UpAxis::kY;
  config_.workspace_box_m = {-1, -2, 0, 3, 4, 5};
  auto connection = make();
  feed(connection, hello());
  const auto sent = feed(connection, empty(kClientArm, Type::kRequestWorkspace));
  Bytes box;
  BigEndianWriter(box).f64(-1).f64(0).f64(-4).f64(3).f64(5).f64(2);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].payload, box);
}

TEST_F(VrpnConnectionTest, IgnoresWhatAClientMustNotChange) {
  auto connection = make();
  feed(connection, hello());
  Bytes asked = empty(kClientArm, Type::kResetOrigin);
  BigEndianWriter(asked)
      .u32(32)
      .u32(0)
      .u32(0)
      .i32(kClientArm)
      .i32(client_type(Type::kSetUpdateRate))
      .u32(0)
      .f64(1e9);
  asked += empty(kClientArm, static_cast<Type>(85));  // vrpn_Button Change: a type that is not ours
  asked += empty(kClientArm, static_cast<Type>(-900));                 // a type never described
  asked += empty(7, Type::kPing);                                      // a sender never described
  BigEndianWriter(asked).u32(24).u32(0).u32(0).i32(3).i32(-4).u32(0);  // log description
  BigEndianWriter(asked).u32(24).u32(0).u32(0).i32(0).i32(-77).u32(0);
  EXPECT_TRUE(feed(connection, asked).empty());
}

TEST_F(VrpnConnectionTest, UdpIsForRequestedConnectionsOnly) {
  auto requested = make(Origin::kRequested);
  feed(requested, hello());
  EXPECT_EQ(requested.udp_port(), 46815);
  auto direct = make(Origin::kDirect);
  feed(direct, hello());
  EXPECT_FALSE(direct.udp_port());
  config_.udp_reports = false;
  auto tcp_only = make(Origin::kRequested);
  feed(tcp_only, hello());
  EXPECT_FALSE(tcp_only.udp_port());
}

TEST_F(VrpnConnectionTest, DescribesANewBodyOnce) {
  auto connection = make();
  Bytes out;
  connection.describe_new_senders(kNow_ns, out);
  EXPECT_TRUE(out.empty()) << "before the cookie nothing may be described";
  feed(connection, hello("rover"));
  senders_.update(SceneModel{2, {{1, "drone"}, {2, "arm"}, {3, "rover"}}});
  connection.describe_new_senders(kNow_ns, out);
  const auto sent = split(out);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].header.sender, 3);
  EXPECT_EQ(sent[0].name(), "rover");
  out.clear();
  connection.describe_new_senders(kNow_ns, out);
  EXPECT_TRUE(out.empty());
  // The client had named it before it existed.
  const auto pong = feed(connection, empty(kClientArm, Type::kPing));
  ASSERT_EQ(pong.size(), 1u);
  EXPECT_EQ(pong[0].header.sender, 3);
}

TEST_F(VrpnConnectionTest, ARetiredBodyIsNotAnswered) {
  auto connection = make();
  feed(connection, hello());
  senders_.update(SceneModel{2, {{1, "drone"}}});
  for (const auto& message : feed(connection, empty(kClientArm, Type::kPing)))
    EXPECT_NE(message.header.type, 17);
}

TEST_F(VrpnConnectionTest, ExplainsAnUnknownBodyOnceAndToThisClientOnly) {
  auto connection = make();
  feed(connection, hello());
  feed(connection, description(kSenderDescription, kClientGhost, "ghost"));
  const auto sent = feed(connection, empty(kClientGhost, Type::kPing));
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(sent[0].header.type, -1);
  EXPECT_EQ(sent[0].header.sender, 1999);
  EXPECT_EQ(sent[0].name(), "ghost");
  EXPECT_EQ(sent[1].header.sender, 1999);
  EXPECT_EQ(sent[1].header.type, 15);
  const auto text = decode_text(sent[1].payload);
  ASSERT_TRUE(text);
  EXPECT_EQ(text->severity, Severity::kWarning);
  EXPECT_THAT(std::string(text->text), HasSubstr("drone, arm"));
  EXPECT_THAT(connection.take_notes().at(0).text, HasSubstr("ghost"));
  EXPECT_TRUE(feed(connection, empty(kClientGhost, Type::kPing)).empty());

  auto other = make();
  for (const auto& message : feed(other, hello())) {
    EXPECT_LT(message.header.type, 0);
    EXPECT_NE(message.name(), "ghost");
  }
}

}  // namespace
}  // namespace fiducap::vrpn
