#include "streaming/vrpn/connection.hpp"

#include <gmock/gmock.h>

#include <random>

#include "base/byte_reader.hpp"
#include "base/byte_writer.hpp"
#include "golden.hpp"

namespace fiducap::vrpn {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::byte>;

constexpr std::int64_t kNow_ns = 1'700'000'000'000'000'000;

// The client numbers as no server would, so that an answer with the wrong table cannot pass.
constexpr std::int32_t kClientArm = 40;
constexpr std::int32_t kClientGhost = 41;
constexpr std::int32_t client_type(Type type) { return 90 - static_cast<std::int32_t>(type); }

Header from_client(std::int32_t sender, std::int32_t type) { return {kNow_ns, sender, type, 0}; }

Bytes& operator+=(Bytes& a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Bytes description(std::int32_t kind, std::int32_t id, std::string_view name) {
  Bytes out;
  encode_description(from_client(id, kind), name, out);
  return out;
}

Bytes empty(std::int32_t sender, Type type) {
  Bytes out;
  encode_empty(from_client(sender, client_type(type)), out);
  return out;
}

Bytes udp_description(std::int32_t port) {
  Bytes out;
  BigEndianWriter(out).u32(34).u32(0).u32(0).i32(port).i32(-3).u32(0).text("127.0.0.1").zeros(7);
  return out;
}

/// Cookie, UDP offer, names and types, as libvrpn sends them.
Bytes hello(std::string_view name = "arm") {
  Bytes out = golden("cookie");
  out += udp_description(46815);
  out += description(kSenderDescription, 39, "VRPN Control");
  out += description(kSenderDescription, kClientArm, name);
  for (std::size_t i = 0; i < kTypeNames.size(); ++i) {
    out += description(kTypeDescription, client_type(static_cast<Type>(i)), kTypeNames[i]);
  }
  out += description(kTypeDescription, 5, "vrpn_Button Change");
  return out;
}

struct Sent {
  Header header;
  Bytes payload;
  [[nodiscard]] std::string name() const { return std::string(*decode_name(payload)); }
};

std::vector<Sent> split(std::span<const std::byte> bytes) {
  std::vector<Sent> all;
  while (!bytes.empty()) {
    const auto message = decode_message(bytes);
    if (!message) {
      ADD_FAILURE() << message.error().text();
      break;
    }
    all.push_back({message->header, {message->payload.begin(), message->payload.end()}});
    bytes = bytes.subspan(message->size);
  }
  return all;
}

class VrpnConnectionTest : public testing::Test {
 protected:
  VrpnConnectionTest() { senders_.update(SceneModel{1, {{1, "drone"}, {2, "arm"}}}); }

  Connection make(Origin origin = Origin::kRequested) { return {config_, senders_, origin}; }
  /// Feeds one piece. @return what the server answers.
  std::vector<Sent> feed(Connection& connection, const Bytes& bytes) {
    Bytes out;
    const auto result = connection.receive(bytes, kNow_ns, out);
    EXPECT_TRUE(result) << result.error().text();
    return split(out);
  }

  VrpnConfig config_;
  SenderTable senders_;
};

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

TEST_F(VrpnConnectionTest, RefusesAnotherMajorVersion) {
  auto connection = make();
  Bytes cookie = golden("cookie");
  cookie[12] = std::byte{'6'};
  Bytes out;
  const auto result = connection.receive(cookie, kNow_ns, out);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kUnsupported);
  EXPECT_TRUE(out.empty());
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
  BigEndianWriter(asked).u32(32).u32(0).u32(0).i32(kClientArm).i32(client_type(Type::kSetUpdateRate)).u32(0).f64(1e9);
  asked += empty(kClientArm, static_cast<Type>(85));  // vrpn_Button Change: a type that is not ours
  asked += empty(kClientArm, static_cast<Type>(-900));  // a type never described
  asked += empty(7, Type::kPing);                       // a sender never described
  BigEndianWriter(asked).u32(24).u32(0).u32(0).i32(3).i32(-4).u32(0);  // log description
  BigEndianWriter(asked).u32(24).u32(0).u32(0).i32(0).i32(-77).u32(0);
  EXPECT_TRUE(feed(connection, asked).empty());
}

TEST_F(VrpnConnectionTest, TakesBytesCutAnywhere) {
  Bytes all = hello();
  all += empty(kClientArm, Type::kPing);
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

TEST_F(VrpnConnectionTest, TakesSingleBytes) {
  Bytes all = hello();
  all += empty(kClientArm, Type::kPing);
  auto connection = make();
  Bytes out;
  for (const std::byte b : all) ASSERT_TRUE(connection.receive({&b, 1}, kNow_ns, out));
  EXPECT_EQ(split(out).size(), 22u);
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

TEST_F(VrpnConnectionTest, RefusesUdpToLowPorts) {
  auto connection = make();
  feed(connection, golden("cookie"));
  feed(connection, udp_description(53));
  EXPECT_FALSE(connection.udp_port());
  EXPECT_THAT(connection.take_notes().at(0).text, HasSubstr("came 53"));
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
  for (const auto& message : feed(connection, empty(kClientArm, Type::kPing))) EXPECT_NE(message.header.type, 17);
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

TEST_F(VrpnConnectionTest, ExplainsAtMostFourUnknownBodies) {
  auto connection = make();
  feed(connection, hello());
  std::size_t sent = 0;
  for (int i = 0; i < 100; ++i) {
    feed(connection, description(kSenderDescription, 100 + i, "ghost" + std::to_string(i)));
    sent += feed(connection, empty(100 + i, Type::kPing)).size();
  }
  EXPECT_EQ(sent, 8u);
  EXPECT_LE(connection.take_notes().size(), 16u);
}

TEST_F(VrpnConnectionTest, NeverRepeatsANameTooLongForClients) {
  auto connection = make();
  feed(connection, hello());
  feed(connection, description(kSenderDescription, kClientGhost, std::string(96, 'x')));
  EXPECT_TRUE(feed(connection, empty(kClientGhost, Type::kPing)).empty());
}

TEST_F(VrpnConnectionTest, SurvivesADescriptionFlood) {
  auto connection = make();
  feed(connection, hello());
  for (std::int32_t id = -50; id < 5000; ++id) {
    feed(connection, description(kSenderDescription, id, "x" + std::to_string(id)));
    feed(connection, description(kTypeDescription, id + 3000, "y"));
  }
  // Ids outside 0..1999 left no trace: they cannot be used.
  feed(connection, description(kSenderDescription, 2000, "arm"));
  EXPECT_TRUE(feed(connection, empty(2000, Type::kPing)).empty());
  // A redefined id counts.
  feed(connection, description(kSenderDescription, 1999, "arm"));
  EXPECT_EQ(feed(connection, empty(1999, Type::kPing)).size(), 1u);
}

TEST_F(VrpnConnectionTest, ATypeIdCanBeRedefined) {
  auto connection = make();
  feed(connection, hello());
  feed(connection, description(kTypeDescription, client_type(Type::kPing), "vrpn_Dial update"));
  EXPECT_TRUE(feed(connection, empty(kClientArm, Type::kPing)).empty());
}

TEST_F(VrpnConnectionTest, IgnoresANameOf64KiB) {
  auto connection = make();
  feed(connection, hello());
  Bytes huge;
  BigEndianWriter(huge).u32(24 + 64000).u32(0).u32(0).i32(kClientGhost).i32(-1).u32(0).u32(63996).zeros(63996);
  std::fill(huge.begin() + 28, huge.end(), std::byte{'a'});
  EXPECT_TRUE(feed(connection, huge).empty());
  EXPECT_TRUE(feed(connection, empty(kClientGhost, Type::kPing)).empty());
  EXPECT_EQ(feed(connection, empty(kClientArm, Type::kPing)).size(), 1u) << "the conversation goes on";
}

TEST_F(VrpnConnectionTest, ClosesAtALengthOfFourGigabytes) {
  auto connection = make();
  feed(connection, hello());
  Bytes out;
  const auto result = connection.receive(from_hex("ffffffff"), kNow_ns, out);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().text(), HasSubstr("4294967295"));
}

TEST_F(VrpnConnectionTest, ClosesAtGarbageInsteadOfACookie) {
  auto connection = make();
  Bytes out;
  const std::string http = "GET / HTTP/1.1\r\nHost: localhost\r\n";
  EXPECT_FALSE(connection.receive(std::as_bytes(std::span(http)), kNow_ns, out));
  EXPECT_TRUE(out.empty());
}

TEST_F(VrpnConnectionTest, SurvivesRandomBytesAfterAValidHello) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int round = 0; round < 300; ++round) {
    auto connection = make();
    feed(connection, hello());
    Bytes noise(256);
    for (auto& b : noise) b = static_cast<std::byte>(byte(random));
    noise[0] = noise[1] = noise[2] = std::byte{0};
    noise[3] = std::byte{static_cast<unsigned char>(24 + round % 200)};
    // System messages and known types with random contents, not only unknown ones.
    if (round % 2 == 0) std::fill(noise.begin() + 16, noise.begin() + 19, std::byte{0xff});
    Bytes out;
    for (int i = 0; i < 4 && connection.receive(noise, kNow_ns, out); ++i) {
    }
    ASSERT_LT(out.size(), 10000u);
    split(out);
  }
}

TEST_F(VrpnConnectionTest, ReadsLengthsThatCountThePadding) {
  // A small Rust client does so.
  auto connection = make();
  feed(connection, hello());
  Bytes padded;
  BigEndianWriter(padded).u32(24 + 16).u32(0).u32(0).i32(kClientGhost).i32(-1).u32(0).u32(6).text("drone").zeros(7);
  feed(connection, padded);
  const auto sent = feed(connection, empty(kClientGhost, Type::kPing));
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].header.sender, 1);
}

TEST_F(VrpnConnectionTest, NotesAClientsTextWithoutControlCharacters) {
  auto connection = make();
  feed(connection, hello());
  Bytes text;
  encode_text(from_client(kClientArm, client_type(Type::kText)), {Severity::kError, 0, "lost\x1b[2J"}, text);
  EXPECT_TRUE(feed(connection, text).empty());
  const auto notes = connection.take_notes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].text, "says: lost.[2J");
  for (int i = 0; i < 1000; ++i) feed(connection, text);
  EXPECT_LE(connection.take_notes().size(), 15u);
}

}  // namespace
}  // namespace fiducap::vrpn
