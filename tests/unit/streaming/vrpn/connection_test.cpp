#include "streaming/vrpn/connection.hpp"

#include <gmock/gmock.h>

#include "connection_fixture.hpp"

namespace fiducap::vrpn {
namespace {

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
