// What strangers and faulty clients send.
#include <gmock/gmock.h>

#include <random>

#include "connection_fixture.hpp"

namespace fiducap::vrpn {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

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

TEST_F(VrpnConnectionTest, RefusesUdpToLowPorts) {
  auto connection = make();
  feed(connection, golden("cookie"));
  feed(connection, udp_description(53));
  EXPECT_FALSE(connection.udp_port());
  EXPECT_THAT(connection.take_notes().at(0).text, HasSubstr("got 53"));
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

TEST_F(VrpnConnectionTest, IgnoresANameOf64KiB) {
  auto connection = greeted();
  Bytes name = from_hex("0000f9fc");  // 63996
  name.resize(64000, std::byte{'a'});
  EXPECT_THAT(feed(connection, raw_message(24 + 64000, kClientGhost, -1, name)), IsEmpty());
  EXPECT_THAT(ping(connection, kClientGhost), IsEmpty());
  EXPECT_THAT(ping(connection, kClientArm), SizeIs(1)) << "the conversation continues";
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

TEST_F(VrpnConnectionTest, SurvivesRandomBytesAfterAValidHello) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int round = 0; round < 300; ++round) {
    auto connection = greeted();
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
  // As a small Rust client sends them.
  auto connection = greeted();
  feed(connection, raw_message(24 + 16, kClientGhost, -1,
                               from_hex("00000006 64726f6e65 00 000000000000")));  // drone
  const auto sent = ping(connection, kClientGhost);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].header.sender, 1);
}

TEST_F(VrpnConnectionTest, NotesAClientsTextWithoutControlCharacters) {
  auto connection = greeted();
  Bytes text;
  encode_text(from_client(kClientArm, client_type(Type::kText)),
              {Severity::kError, 0, "lost\x1b[2J"}, text);
  EXPECT_THAT(feed(connection, text), IsEmpty());
  const auto notes = connection.take_notes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].text, "sent text: lost.[2J");
  for (int i = 0; i < 1000; ++i) feed(connection, text);
  EXPECT_LE(connection.take_notes().size(), 15u);
}

}  // namespace
}  // namespace fiducap::vrpn
