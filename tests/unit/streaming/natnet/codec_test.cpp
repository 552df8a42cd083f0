#include <gtest/gtest.h>

#include <set>

#include "messages.hpp"
#include "streaming/natnet/codec.hpp"
#include "support/hex.hpp"

namespace fiducap::natnet {
namespace {

constexpr Bitstream kDefault{3, 1};

TEST(Bitstream, ReadsTwoToFourParts) {
  EXPECT_EQ(parse_bitstream("3.1"), (Bitstream{3, 1}));
  EXPECT_EQ(parse_bitstream("2.10.0"), (Bitstream{2, 10}));
  EXPECT_EQ(parse_bitstream("4.1.7.9"), (Bitstream{4, 1}));
  EXPECT_EQ(parse_bitstream("255.255"), (Bitstream{255, 255}));
}

TEST(Bitstream, RefusesEveryOtherText) {
  for (const char* text : {"", "3", "3.", ".1", "3.1.", "3.1.0.0.0", "3.-1", "256.0", "3.1x", "x",
                           " 3.1", "3..1", "1e1.0"}) {
    EXPECT_EQ(parse_bitstream(text), std::nullopt) << text;
  }
}

TEST(Bitstream, TwoTenComesAfterTwoNine) {
  EXPECT_LT((Bitstream{2, 9}), (Bitstream{2, 10}));
  EXPECT_EQ(frame_layout({2, 10}), FrameLayout::k2_9);
}

TEST(Bitstream, EverySupportedOneHasItsName) {
  for (const Bitstream version : kBitstreams) {
    EXPECT_TRUE(is_supported(version));
    EXPECT_EQ(parse_bitstream(text_of(version)), version);
  }
  EXPECT_FALSE(is_supported({4, 3}));
  EXPECT_FALSE(is_supported({2, 4}));
}

TEST(Negotiation, AClientThatDoesNotSayGetsTheDefault) {
  EXPECT_EQ(negotiate({}, kDefault), kDefault);
}

TEST(Negotiation, AClientGetsWhatItWants) {
  EXPECT_EQ(negotiate({Bitstream{4, 2}, Bitstream{2, 7}}, kDefault), (Bitstream{2, 7}));
  EXPECT_EQ(negotiate({Bitstream{4, 2}, Bitstream{4, 2}}, kDefault), (Bitstream{4, 2}));
}

TEST(Negotiation, WantingNothingLeavesTheChoiceToTheServer) {
  EXPECT_EQ(negotiate({Bitstream{4, 2}, Bitstream{}}, kDefault), kDefault);
}

TEST(Negotiation, AnOldLibraryIsNeverSentMoreThanItKnows) {
  EXPECT_EQ(negotiate({Bitstream{2, 7}, {}}, kDefault), (Bitstream{2, 7}));
  EXPECT_EQ(negotiate({Bitstream{3, 0}, {}}, Bitstream{4, 1}), (Bitstream{3, 0}));
}

TEST(Negotiation, ALibraryVersionFromBeforeTheProtocolIsNoInformation) {
  EXPECT_EQ(negotiate({Bitstream{0, 0}, {}}, kDefault), kDefault);
  EXPECT_EQ(negotiate({Bitstream{1, 4}, {}}, kDefault), kDefault);
}

TEST(Negotiation, AlwaysEndsAtOneThatWeHave) {
  for (int major = 0; major < 256; ++major) {
    for (int minor = 0; minor < 256; ++minor) {
      const Bitstream any{static_cast<std::uint8_t>(major), static_cast<std::uint8_t>(minor)};
      EXPECT_TRUE(is_supported(negotiate({{}, any}, kDefault))) << text_of(any);
      EXPECT_TRUE(is_supported(negotiate({any, {}}, kDefault))) << text_of(any);
    }
  }
  EXPECT_EQ(negotiate({{}, Bitstream{255, 255}}, kDefault), kNewest);
  EXPECT_EQ(negotiate({{}, Bitstream{4, 3}}, kDefault), (Bitstream{4, 2}));
  EXPECT_EQ(negotiate({{}, Bitstream{3, 9}}, kDefault), (Bitstream{3, 1}));
  EXPECT_EQ(negotiate({{}, Bitstream{1, 0}}, kDefault), kOldest);
}

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

TEST(Request, DecodesTheConnectRequestOfANewLibrary) {
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
  const auto full =
      decoded<KeepAliveRequest>(message(Message::kKeepAlive, sender_block({4, 1}, "lab")));
  EXPECT_EQ(full.name, "lab");
  EXPECT_EQ(full.versions.library, (Bitstream{4, 1}));
}

TEST(Request, NamesAreMadeFitForALog) {
  Bytes payload = sender_block({3, 1}, "a\nb\x1b[31m");
  EXPECT_EQ(decoded<ConnectRequest>(message(Message::kConnect, payload)).name, "a?b?[31m");
  payload.assign(264, std::byte{0xff});
  EXPECT_EQ(decoded<ConnectRequest>(message(Message::kConnect, payload)).name,
            std::string(64, '?'));
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
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_EQ(decode_request(std::span(whole).first(n)).has_value(), n >= 4) << n;
}

TEST(Request, SixtyFourKilobytesOfNameAreCut) {
  Bytes payload(65503, std::byte{'n'});
  EXPECT_EQ(decoded<ConnectRequest>(message(Message::kConnect, payload)).name.size(), 64U);
  EXPECT_EQ(decoded<CommandRequest>(message(Message::kRequest, payload)).text.size(),
            payload.size());
}

const ServerInfo kInfo{{2, 1, 0, 7}, {3, 1}, 1511, true, {239, 255, 42, 99}};

std::string name_field() { return "46696475636170" + std::string(2 * (256 - 7), '0'); }

TEST(Answer, ServerInfoByteForByte) {
  EXPECT_EQ(to_hex(encode(kInfo)), to_hex(from_hex("0100 1701" + name_field() +
                                                   "02010007"              // application
                                                   "03010000"              // bitstream
                                                   "8096980000000000"      // 10 MHz
                                                   "e705 01 efff2a63")));  // port, multicast, group
}

TEST(Answer, ServerInfoBeforeThreeEndsWithTheVersion) {
  ServerInfo info = kInfo;
  info.bitstream = {2, 10};
  EXPECT_EQ(to_hex(encode(info)),
            to_hex(from_hex("0100 0801" + name_field() + "02010007 020a0000")));
}

TEST(Answer, EchoCountsTicksOfTheFrames) {
  EXPECT_EQ(to_hex(encode_echo(278554190, instant_from_ns(123'456'789'000))),
            to_hex(from_hex("0d00 1000 4e669a1000000000 d2029649 00000000")));
}

// The answers of a commercial server, 3.0: 120 Hz, and 0 analog samples.
TEST(Answer, NumbersAreFourBytes) {
  EXPECT_EQ(encode_response(120.0F), from_hex("03000400 0000f042"));
  EXPECT_EQ(encode_response(std::int32_t{0}), from_hex("03000400 00000000"));
}

TEST(Answer, TextEndsWithNulAndFitsTheClientsBuffer) {
  EXPECT_EQ(encode_text_response("/"), from_hex("03000200 2f00"));
  const auto longest = encode_text_response(std::string(70000, 'x'));
  EXPECT_EQ(longest.size(), kHeaderSize + 256);
  EXPECT_EQ(longest.back(), std::byte{0});
}

TEST(Answer, TheBitstreamHasNoNul) {
  EXPECT_EQ(encode_bitstream_response({3, 1}), from_hex("03000f00 42697473747265616d2c332e312e30"));
}

TEST(Answer, UnrecognizedIsOneHundred) { EXPECT_EQ(encode_unrecognized(), from_hex("6400 0000")); }

const std::vector<BodyDescription> kTwo{{9, "arm"},
                                        {12,
                                         "k\xc3\xa4"
                                         "fer"}};
const NameRule kRule{255, ",", false, true};

SceneModel model_of(int bodies, std::size_t name_bytes) {
  SceneModel model;
  for (int i = 1; i <= bodies; ++i) {
    std::string name = std::to_string(i) + "_";
    name.resize(name_bytes, 'n');
    model.bodies.push_back({i, name});
  }
  return model;
}

TEST(ModelEncoder, BeforeThreeThereAreNoMarkers) {
  EXPECT_EQ(
      to_hex(encode_model(kTwo, ModelLayout::k2_5)),
      to_hex(from_hex("0500 3f00 02000000"
                      "01000000 61726d00       09000000 ffffffff 000000000000000000000000"
                      "01000000 6bc3a4666572 00 0c000000 ffffffff 000000000000000000000000")));
}

TEST(ModelEncoder, FromThreeAnEmptyListOfMarkersFollows) {
  const std::span one(kTwo.data(), 1);
  const auto wanted = from_hex(
      "0500 2400 01000000 01000000 61726d00 09000000 ffffffff 000000000000000000000000 00000000");
  EXPECT_EQ(to_hex(encode_model(one, ModelLayout::k3_0)), to_hex(wanted));
  EXPECT_EQ(to_hex(encode_model(one, ModelLayout::k4_0)), to_hex(wanted));
}

TEST(ModelEncoder, FromFourOneEachDescriptionSaysItsSize) {
  const std::span one(kTwo.data(), 1);
  EXPECT_EQ(to_hex(encode_model(one, ModelLayout::k4_1)),
            to_hex(from_hex("0500 2800 01000000 01000000 1c000000 61726d00 09000000 ffffffff"
                            "000000000000000000000000 00000000")));
}

TEST(ModelEncoder, FromFourTwoARotationFollowsTheOffset) {
  const std::span one(kTwo.data(), 1);
  EXPECT_EQ(to_hex(encode_model(one, ModelLayout::k4_2)),
            to_hex(from_hex("0500 3800 01000000 01000000 2c000000 61726d00 09000000 ffffffff"
                            "000000000000000000000000 0000000000000000000000000000803f 00000000")));
}

TEST(ModelEncoder, SaysNothingOfTypesThatWereNotAskedFor) {
  EXPECT_EQ(encode_model(kTwo, ModelLayout::k4_1, 1U << 5), from_hex("0500 0400 00000000"));
  EXPECT_EQ(encode_model(kTwo, ModelLayout::k4_1, ModelRequest::kRigidBodies),
            encode_model(kTwo, ModelLayout::k4_1));
}

TEST(AnnouncedBodies, NamesCanBeAddressedByCommands) {
  SceneModel model;
  model.bodies = {{1, "left,arm"}, {2, "left_arm"}, {3, "tab\there"}};
  const auto bodies = announced_bodies(model, kRule, {{"tab\there", "alias"}});
  EXPECT_EQ(bodies[0].name, "left_arm_2");
  EXPECT_EQ(bodies[1].name, "left_arm") << "a name that fits as it is stays";
  EXPECT_EQ(bodies[2].name, "alias");
  EXPECT_EQ(bodies[2].id, 3);
}

TEST(AnnouncedBodies, ANameOf64KilobytesIsCutToWhatClientsHold) {
  EXPECT_EQ(announced_bodies(model_of(1, 65536), kRule).front().name.size(), kMaxName);
}

TEST(AnnouncedBodies, AThousandBodiesFitOneDatagramInEveryLayout) {
  const auto bodies = announced_bodies(model_of(1000, 255), kRule);
  ASSERT_EQ(bodies.size(), 1000U);
  std::set<std::string> names;
  for (const auto& body : bodies) EXPECT_TRUE(names.insert(body.name).second) << body.name;
  for (const auto layout : {ModelLayout::k2_5, ModelLayout::k3_0, ModelLayout::k4_0,
                            ModelLayout::k4_1, ModelLayout::k4_2}) {
    EXPECT_LE(encode_model(bodies, layout).size(), kMaxDatagram);
  }
}

TEST(AnnouncedBodies, ShortNamesOfAThousandBodiesStayAsTheyAre) {
  const auto model = model_of(1000, 12);
  const auto bodies = announced_bodies(model, kRule);
  for (std::size_t i = 0; i < bodies.size(); ++i) ASSERT_EQ(bodies[i].name, model.bodies[i].name);
}

TEST(AnnouncedBodies, MoreThanClientsTakeAreLeftOut) {
  EXPECT_EQ(announced_bodies(model_of(1300, 6), kRule).size(), kMaxBodies);
}

}  // namespace
}  // namespace fiducap::natnet
