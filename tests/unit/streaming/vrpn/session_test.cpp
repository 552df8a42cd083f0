#include "streaming/vrpn/session.hpp"

#include <gmock/gmock.h>

#include "connection_fixture.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vrpn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;
using testing::SizeIs;

TEST(VrpnConfig, ReportsEveryBrokenRule) {
  EXPECT_TRUE(VrpnConfig{}.check().empty());
  VrpnConfig config;
  config.address = "localhost";
  config.max_clients = 0;
  config.minor_version = 100;
  config.workspace_box_m = {0, 0, 0, 1, -1, 1};
  const auto errors = config.check();
  ASSERT_EQ(errors.size(), 4u);
  EXPECT_EQ(errors[0].text(),
            "streaming.vrpn.address = localhost: must be an IPv4 address, e.g. 127.0.0.1 or "
            "0.0.0.0 for all");
  EXPECT_EQ(errors[3].value, "[0, 0, 0, 1, -1, 1]");
}

TEST(VrpnConfig, SensorsBelongToBodiesAndAreLimited) {
  VrpnConfig config;
  config.sensors = {{"arm", Pose{}}, {"drone", Pose{}}, {"arm", Pose{}}};
  EXPECT_TRUE(config.check().empty());
  EXPECT_EQ(config.sensors_of("arm").size(), 2u);
  EXPECT_TRUE(config.sensors_of("rover").empty());
  for (int i = 0; i < 3; ++i) config.sensors.push_back({"arm", Pose{}});
  config.sensors.push_back({"", Pose{}});
  config.sensors.push_back({"drone", {Eigen::Quaterniond(2, 0, 0, 0), Eigen::Vector3d::Zero()}});
  const auto errors = config.check();
  ASSERT_EQ(errors.size(), 7u);  // five of the arm, one without a body, one that is no attitude
  EXPECT_EQ(errors.back().path, "streaming.vrpn.sensors.7.X_PS");
}

SceneModel model(std::uint64_t generation, const std::vector<std::string>& names) {
  SceneModel made{generation, {}};
  for (const auto& name : names)
    made.bodies.push_back({static_cast<int>(made.bodies.size()) + 1, name});
  return made;
}

TEST(VrpnSenderTable, NeverReusesAnId) {
  SenderTable table;
  EXPECT_THAT(table.update(model(1, {"arm", "drone"})), IsEmpty());
  EXPECT_THAT(table.names(), ElementsAre("VRPN Control", "arm", "drone"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(1, 2));
  EXPECT_EQ(table.list_bodies(), "arm, drone");
  table.update(model(2, {"rover", "drone"}));
  EXPECT_THAT(table.names(), ElementsAre("VRPN Control", "arm", "drone", "rover"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(3, 2));
  EXPECT_FALSE(table.find_body("arm"));
  EXPECT_EQ(table.find_body("rover"), 3);
  table.update(model(3, {"arm"}));
  EXPECT_EQ(table.find_body("arm"), 1);
}

TEST(VrpnSenderTable, ReadsAGenerationOnceAndMatchesNamesExactly) {
  SenderTable table;
  table.update(model(1, {"Arm"}));
  table.update(model(1, {"other"}));
  for (const char* name : {"other", "arm", "Arm "}) EXPECT_FALSE(table.find_body(name)) << name;
}

TEST(VrpnSenderTable, RefusesInvalidAndDuplicateNames) {
  SenderTable table;
  const std::string too_long(96, 'x');
  EXPECT_THAT(table.update(model(1, {"arm", "a@b", "arm", too_long, "VRPN Control"})),
              ElementsAre("a@b", "arm", too_long, "VRPN Control"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(1, -1, -1, -1, -1));
  EXPECT_FALSE(table.find_body("VRPN Control"));
}

TEST(VrpnSenderTable, ShowsAliasesAndFindsTheirBodies) {
  SenderTable table(NameAliases{{"drone", "cf7"}, {"arm", "a@b"}});
  EXPECT_THAT(table.update(model(1, {"arm", "drone"})), ElementsAre("a@b"))
      << "an alias obeys the rules, too";
  EXPECT_FALSE(table.find_body("drone"));
  ASSERT_TRUE(table.find_body("cf7"));
  EXPECT_EQ(table.own_name_of(*table.find_body("cf7")), "drone");
}

TEST(VrpnSenderTable, StopsAtTheLargestIdOfClients) {
  SenderTable table;
  EXPECT_THAT(table.update(model(1, numbered_names(2100))), SizeIs(101));  // 0 is VRPN Control
  EXPECT_EQ(table.of_bodies()[1998], 1999);
  EXPECT_EQ(table.of_bodies()[1999], -1);
}

TEST(VrpnBodyName, IsCheckedWithPathAndRule) {
  for (const std::string& name : {std::string(95, 'x'), std::string("Körper 1/a:b")})
    EXPECT_THAT(check_body_name("bodies[0].name", name), IsEmpty()) << name;
  const auto errors = check_body_name("bodies[2].name", "a@\n");
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_EQ(errors[0].path, "bodies[2].name");
  for (const std::string& name : {std::string(), std::string(96, 'x'), std::string("VRPN Control")})
    EXPECT_THAT(check_body_name("x", name), SizeIs(1)) << name;
}

class BodyWatchTest : public testing::Test {
 protected:
  /// One frame 10 ms after the last. @return sender and severity of each text
  std::vector<std::pair<std::int32_t, Severity>> observe(bool a_valid) {
    auto frame = make_scene_frame({"a", "b"}, ++number_);
    frame->bodies[0].valid = a_valid;
    Bytes out;
    watch_.observe(*frame, senders_, out);
    std::vector<std::pair<std::int32_t, Severity>> texts;
    for (const auto& sent : split(out)) {
      EXPECT_EQ(sent.header.type, 15);
      texts.emplace_back(sent.header.sender, decode_text(sent.payload)->severity);
    }
    return texts;
  }

  BodyWatch watch_;
  std::vector<std::int32_t> senders_{1, 2};
  std::uint64_t number_{0};
};

TEST_F(BodyWatchTest, WarnsOnceWhenABodyIsLostAndReportsItsRecovery) {
  EXPECT_THAT(observe(true), IsEmpty());
  EXPECT_THAT(observe(false), ElementsAre(Pair(1, Severity::kWarning)));
  for (int i = 0; i < 500; ++i) EXPECT_THAT(observe(false), IsEmpty());
  EXPECT_THAT(observe(true), ElementsAre(Pair(1, Severity::kNormal)));
}

TEST_F(BodyWatchTest, IgnoresBodiesNeverSeenOrNotServed) {
  for (int i = 0; i < 300; ++i) EXPECT_THAT(observe(false), IsEmpty());
  senders_ = {-1, 2};
  observe(true);
  EXPECT_THAT(observe(false), IsEmpty());
}

TEST_F(BodyWatchTest, ReportsAtMostOncePerSecondAndBody) {
  observe(true);
  std::size_t texts = 0;
  for (int i = 0; i < 500; ++i) texts += observe(i % 2 == 0).size();  // 5 s of flicker
  EXPECT_GE(texts, 3u);
  EXPECT_LE(texts, 6u);
}

TEST_F(VrpnConnectionTest, GreetsFirstAndDescribesSendersAndTypesAfterTheCookie) {
  config_.minor_version = 38;
  EXPECT_EQ(make().greeting(), golden("cookie"));
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

TEST_F(VrpnConnectionTest, AnswersPingsOfServedBodiesButNoDescription) {
  auto connection = make();
  EXPECT_THAT(feed(connection, hello()), SizeIs(21));  // its own, nothing back for the client's
  const auto sent = ping(connection, kClientArm);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].header, (Header{kNow_ns, 2, 17, 0}));
  EXPECT_TRUE(sent[0].payload.empty());
  senders_.update(SceneModel{2, {{1, "drone"}}});
  for (const auto& message : ping(connection, kClientArm)) EXPECT_NE(message.header.type, 17);
}

TEST_F(VrpnConnectionTest, AnswersTheRequestsWithIdentityAndTheWorkspace) {
  auto connection = greeted();
  Bytes asked = empty(kClientArm, Type::kRequestToRoom);
  asked += empty(kClientArm, Type::kRequestUnitToSensor);
  asked += empty(kClientArm, Type::kRequestWorkspace);
  const auto sent = feed(connection, asked);
  Bytes identity;
  BigEndianWriter(identity).zeros(6 * 8).f64(1);
  Bytes with_sensor;
  BigEndianWriter(with_sensor).i32(0).i32(0).bytes(identity);
  Bytes box;
  BigEndianWriter(box).f64(-10).f64(-10).f64(0).f64(10).f64(10).f64(5);
  const std::pair<int, Bytes> kExpected[] = {{7, identity}, {8, with_sensor}, {11, box}};
  ASSERT_EQ(sent.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(sent[i].header.sender, 2);
    EXPECT_EQ(sent[i].header.type, kExpected[i].first);
    EXPECT_EQ(sent[i].payload, kExpected[i].second);
  }
  config_.sensors = {{"arm", Pose{}}};
  EXPECT_THAT(feed(connection, empty(kClientArm, Type::kRequestUnitToSensor)), SizeIs(2))
      << "one per sensor";
}

TEST_F(VrpnConnectionTest, TheWorkspaceTurnsWithTheAxes) {
  config_.up = UpAxis::kY;
  config_.workspace_box_m = {-1, -2, 0, 3, 4, 5};
  auto connection = greeted();
  const auto sent = feed(connection, empty(kClientArm, Type::kRequestWorkspace));
  Bytes box;
  BigEndianWriter(box).f64(-1).f64(0).f64(-4).f64(3).f64(5).f64(2);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].payload, box);
}

TEST_F(VrpnConnectionTest, IgnoresChangesByClients) {
  auto connection = greeted();
  Bytes asked = empty(kClientArm, Type::kResetOrigin);
  asked += raw_message(32, kClientArm, client_type(Type::kSetUpdateRate),
                       from_hex("41cdcd6500000000"));   // 1e9
  asked += empty(kClientArm, static_cast<Type>(85));    // vrpn_Button Change: not one of ours
  asked += empty(kClientArm, static_cast<Type>(-900));  // a type never described
  asked += empty(7, Type::kPing);                       // a sender never described
  asked += raw_message(24, 3, -4);                      // log description
  asked += raw_message(24, 0, -77);
  EXPECT_THAT(feed(connection, asked), IsEmpty());
}

TEST_F(VrpnConnectionTest, UsesUdpForRequestedConnectionsOnly) {
  EXPECT_EQ(greeted(Origin::kRequested).udp_port(), 46815);
  EXPECT_FALSE(greeted(Origin::kDirect).udp_port());
  config_.udp_reports = false;
  EXPECT_FALSE(greeted(Origin::kRequested).udp_port());
}

TEST_F(VrpnConnectionTest, DescribesAnAddedBodyOnce) {
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
  const auto pong = ping(connection, kClientArm);  // of the name the client used before
  ASSERT_EQ(pong.size(), 1u);
  EXPECT_EQ(pong[0].header.sender, 3);
}

TEST_F(VrpnConnectionTest, ExplainsAnUnknownBodyOnceAndToThisClientOnly) {
  auto connection = greeted();
  feed(connection, description(kSenderDescription, kClientGhost, "ghost"));
  const auto sent = ping(connection, kClientGhost);
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
  EXPECT_THAT(ping(connection, kClientGhost), IsEmpty());

  auto other = make();
  for (const auto& message : feed(other, hello())) {
    EXPECT_LT(message.header.type, 0);
    EXPECT_NE(message.name(), "ghost");
  }
}

TEST_F(VrpnConnectionTest, AcceptsBytesCutAnywhere) {
  Bytes all = hello();
  all += empty(kClientArm, Type::kPing);
  auto in_bytes = make();
  Bytes single;
  for (const std::byte b : all) ASSERT_TRUE(in_bytes.receive({&b, 1}, kNow_ns, single));
  EXPECT_THAT(split(single), SizeIs(22));
  all += empty(kClientArm, Type::kRequestToRoom);
  auto whole = make();
  Bytes expected;
  ASSERT_TRUE(whole.receive(all, kNow_ns, expected));
  for (std::size_t cut = 0; cut <= all.size(); ++cut) {
    auto connection = make();
    Bytes out;
    ASSERT_TRUE(connection.receive(std::span(all).first(cut), kNow_ns, out));
    ASSERT_TRUE(connection.receive(std::span(all).subspan(cut), kNow_ns, out));
    ASSERT_EQ(out, expected) << "cut at " << cut;
  }
}

TEST_F(VrpnConnectionTest, ExplainsAtMostFourUnknownBodies) {
  auto connection = greeted();
  std::size_t sent = 0;
  for (int i = 0; i < 100; ++i) {
    feed(connection, description(kSenderDescription, 100 + i, "ghost" + std::to_string(i)));
    sent += ping(connection, 100 + i).size();
  }
  EXPECT_EQ(sent, 8u);
  EXPECT_LE(connection.take_notes().size(), 16u);
}

TEST_F(VrpnConnectionTest, NeverRepeatsANameTooLongForClients) {
  auto connection = greeted();
  feed(connection, description(kSenderDescription, kClientGhost, std::string(96, 'x')));
  EXPECT_THAT(ping(connection, kClientGhost), IsEmpty());
}

TEST_F(VrpnConnectionTest, SurvivesADescriptionFlood) {
  auto connection = greeted();
  for (std::int32_t id = -50; id < 5000; ++id) {
    feed(connection, description(kSenderDescription, id, "x" + std::to_string(id)));
    feed(connection, description(kTypeDescription, id + 3000, "y"));
  }
  feed(connection, description(kSenderDescription, 2000, "arm"));
  EXPECT_THAT(ping(connection, 2000), IsEmpty()) << "only ids 0..1999 can be used";
  feed(connection, description(kSenderDescription, 1999, "arm"));
  EXPECT_THAT(ping(connection, 1999), SizeIs(1)) << "a redefined id counts";
}

TEST_F(VrpnConnectionTest, ATypeIdCanBeRedefined) {
  auto connection = greeted();
  feed(connection, description(kTypeDescription, client_type(Type::kPing), "vrpn_Dial update"));
  EXPECT_THAT(ping(connection, kClientArm), IsEmpty());
}

TEST_F(VrpnConnectionTest, ClosesOnGarbageAndALengthOfFourGigabytes) {
  auto connection = make();
  Bytes out;
  const std::string http = "GET / HTTP/1.1\r\nHost: localhost\r\n";
  EXPECT_FALSE(connection.receive(std::as_bytes(std::span(http)), kNow_ns, out));
  EXPECT_TRUE(out.empty());
  auto running = greeted();
  const auto result = running.receive(from_hex("ffffffff"), kNow_ns, out);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().text(), HasSubstr("4294967295"));
}

TEST_F(VrpnConnectionTest, NotesAClientsTextWithoutControlCharacters) {
  auto connection = greeted();
  Bytes text;
  encode_text(from_client(kClientArm, client_type(Type::kText)),
              {Severity::kError, 0, "lost\x1b[2J"}, text);
  EXPECT_THAT(feed(connection, text), IsEmpty());
  const auto notes = connection.take_notes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].text, "sent text: lost\\x1b[2J");
  for (int i = 0; i < 1000; ++i) feed(connection, text);
  EXPECT_LE(connection.take_notes().size(), 15u);
}

}  // namespace
}  // namespace fiducap::vrpn
