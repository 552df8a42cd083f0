#include "streaming/natnet/request.hpp"

#include <gtest/gtest.h>

#include "messages.hpp"
#include "support/hex.hpp"

namespace fiducap::natnet {
namespace {

template <typename T>
T decoded(const Bytes& datagram) {
  const auto request = decode_request(datagram);
  EXPECT_TRUE(request) << (request ? "" : request.error().text());
  if (!request || !std::holds_alternative<T>(*request)) {
    ADD_FAILURE() << "another kind of request";
    return {};
  }
  return std::get<T>(*request);
}

TEST(Request, AnEmptyConnectAsksOnly) {
  const auto connect = decoded<ConnectRequest>(from_hex("0000 0000"));
  EXPECT_TRUE(connect.empty);
  EXPECT_FALSE(connect.versions.library);
}

TEST(Request, PingIsAConnectWithoutVersions) {
  const auto connect = decoded<ConnectRequest>(ping());
  EXPECT_FALSE(connect.empty);
  EXPECT_EQ(connect.name, "Ping");
  EXPECT_FALSE(connect.versions.library);
}

TEST(Request, AnOldLibrarySaysWhatItKnows) {
  const auto sent = decoded<ConnectRequest>(natnet::connect({3, 0}));
  EXPECT_EQ(sent.name, "NatNetLib");
  EXPECT_EQ(sent.versions.library, (Bitstream{3, 0}));
  EXPECT_FALSE(sent.versions.wanted);
}

TEST(Request, ANewLibrarySaysWhatItWants) {
  const auto sent = decoded<ConnectRequest>(natnet::connect({4, 1}, {2, 7}, true));
  EXPECT_EQ(sent.versions.wanted, (Bitstream{2, 7}));
  EXPECT_TRUE(sent.subscribed_data_only);
}

TEST(Request, OptionsOnlyCountWhenTheyAreAllThere) {
  Bytes datagram = natnet::connect({4, 1}, {2, 7});
  datagram.pop_back();
  EXPECT_FALSE(decoded<ConnectRequest>(datagram).versions.wanted);
}

TEST(Request, TheDatagramMayBeLongerOrShorterThanItsHeaderSays) {
  Bytes longer = words("FrameRate");
  longer.push_back(std::byte{0});
  EXPECT_EQ(decoded<CommandRequest>(longer).text, "FrameRate");
  // Header 16, text 9, no NUL.
  const Bytes shorter = from_hex("0200 1000 4672616d6552617465");
  EXPECT_EQ(decoded<CommandRequest>(shorter).text, "FrameRate");
}

TEST(Request, ACommandEndsAtItsFirstNul) {
  Bytes payload;
  LittleEndianWriter(payload).text("GetProperty,,X").u8(0).text("rest");
  const Bytes datagram = message(Message::kRequest, payload);
  EXPECT_EQ(decoded<CommandRequest>(datagram).text, "GetProperty,,X");
}

TEST(Request, AModelRequestWithoutMaskWantsEverything) {
  EXPECT_EQ(decoded<ModelRequest>(from_hex("0400 0000")).types, ~0U);
  EXPECT_EQ(decoded<ModelRequest>(from_hex("0400 0100 00")).types, ~0U);
  EXPECT_EQ(decoded<ModelRequest>(from_hex("0400 0400 02000000")).types, 2U);
}

// Captured between a commercial server and its library, 3.0.
TEST(Request, ReadsARecordedEcho) {
  EXPECT_EQ(decoded<EchoRequest>(from_hex("0c000800 4e669a1000000000")).client_ticks, 278554190U);
}

TEST(Request, KeepAliveComesInThreeLengths) {
  EXPECT_TRUE(decoded<KeepAliveRequest>(from_hex("0a00 0000")).name.empty());
  EXPECT_TRUE(decoded<KeepAliveRequest>(from_hex("0a00 0100 00")).name.empty());
  const auto full = decoded<KeepAliveRequest>(message(Message::kKeepAlive, sender_block({4, 1}, "lab")));
  EXPECT_EQ(full.name, "lab");
  EXPECT_EQ(full.versions.library, (Bitstream{4, 1}));
}

TEST(Request, NamesAreMadeFitForALog) {
  Bytes payload = sender_block({3, 1}, "a\nb\x1b[31m");
  EXPECT_EQ(decoded<ConnectRequest>(message(Message::kConnect, payload)).name, "a?b?[31m");
  payload.assign(264, std::byte{0xff});
  EXPECT_EQ(decoded<ConnectRequest>(message(Message::kConnect, payload)).name, std::string(64, '?'));
}

TEST(Request, ServersMessagesAreNoRequests) {
  for (const int id : {1, 3, 5, 7, 8, 11, 13, 15, 99, 100, 255, 256, 65535}) {
    EXPECT_FALSE(decode_request(message(static_cast<Message>(id)))) << id;
  }
}

TEST(Request, EveryTruncationOfAnEchoIsAnError) {
  const Bytes whole = from_hex("0c000800 4e669a1000000000");
  for (std::size_t n = 0; n < whole.size(); ++n) {
    EXPECT_FALSE(decode_request(std::span(whole).first(n))) << n;
  }
}

TEST(Request, EveryTruncationOfAConnectIsRead) {
  const Bytes whole = natnet::connect({4, 1}, {4, 1});
  for (std::size_t n = 0; n < whole.size(); ++n) EXPECT_EQ(decode_request(std::span(whole).first(n)).has_value(), n >= 4) << n;
}

TEST(Request, SixtyFourKilobytesOfNameAreCut) {
  Bytes payload(65503, std::byte{'n'});
  EXPECT_EQ(decoded<ConnectRequest>(message(Message::kConnect, payload)).name.size(), 64U);
  EXPECT_EQ(decoded<CommandRequest>(message(Message::kRequest, payload)).text.size(), payload.size());
}

}  // namespace
}  // namespace fiducap::natnet
