#include "streaming/natnet/codec.hpp"

#include <gmock/gmock.h>

#include <set>

#include "messages.hpp"
#include "support/hex.hpp"

namespace fiducap::natnet {
namespace {

constexpr Bitstream kDefault{3, 1};

TEST(Bitstream, ReadsTwoToFourParts) {
  EXPECT_EQ(parse_bitstream("3.1"), (Bitstream{3, 1}));
  EXPECT_EQ(parse_bitstream("2.10.0"), (Bitstream{2, 10}));
  EXPECT_EQ(parse_bitstream("4.1.7.9"), (Bitstream{4, 1}));
  EXPECT_EQ(parse_bitstream("255.255"), (Bitstream{255, 255}));
  for (const char* text : {"", "3", "3.", ".1", "3.1.", "3.1.0.0.0", "3.-1", "256.0", "3.1x", "x",
                           " 3.1", "3..1", "1e1.0"}) {
    EXPECT_EQ(parse_bitstream(text), std::nullopt) << text;
  }
}

TEST(Bitstream, SupportedVersionsAreOrderedAndHaveNames) {
  EXPECT_LT((Bitstream{2, 9}), (Bitstream{2, 10}));
  EXPECT_EQ(frame_layout({2, 10}), FrameLayout::k2_9);
  for (const Bitstream version : kBitstreams) {
    EXPECT_TRUE(is_supported(version));
    EXPECT_EQ(parse_bitstream(text_of(version)), version);
  }
  EXPECT_FALSE(is_supported({4, 5}));
  EXPECT_FALSE(is_supported({2, 4}));
}

TEST(Negotiation, UsesTheRequestedVersionOrOneThatTheLibraryKnows) {
  struct Case {
    const char* what;
    ClientVersions client;
    Bitstream server, agreed;
  };
  const Case kCases[] = {
      {"nothing known", {}, kDefault, kDefault},
      {"an older version requested", {Bitstream{4, 2}, Bitstream{2, 7}}, kDefault, {2, 7}},
      {"a newer version requested", {Bitstream{4, 2}, Bitstream{4, 2}}, kDefault, {4, 2}},
      {"no version requested", {Bitstream{4, 2}, Bitstream{}}, kDefault, kDefault},
      {"an old library", {Bitstream{2, 7}, {}}, kDefault, {2, 7}},
      {"an older library than the server", {Bitstream{3, 0}, {}}, {4, 1}, {3, 0}},
      {"library 0.0 is no information", {Bitstream{0, 0}, {}}, kDefault, kDefault},
      {"library 1.4 is no information", {Bitstream{1, 4}, {}}, kDefault, kDefault},
      {"newer than the newest", {{}, Bitstream{255, 255}}, kDefault, kNewest},
      {"a minor version too new", {{}, Bitstream{4, 9}}, kDefault, {4, 4}},
      {"a new library gets its own", {Bitstream{4, 4}, Bitstream{}}, kDefault, {4, 4}},
      {"a new library requests an older one", {Bitstream{4, 4}, Bitstream{3, 1}}, kDefault, {3, 1}},
      {"a library newer than ours", {Bitstream{5, 0}, Bitstream{}}, kDefault, {4, 4}},
      {"the nearest below", {{}, Bitstream{3, 9}}, kDefault, {3, 1}},
      {"older than the oldest", {{}, Bitstream{1, 0}}, kDefault, kOldest}};
  for (const auto& [what, client, server, agreed] : kCases)
    EXPECT_EQ(negotiate(client, server), agreed) << what;
}

TEST(Negotiation, AlwaysEndsAtASupportedVersion) {
  for (int major = 0; major < 256; ++major) {
    for (int minor = 0; minor < 256; ++minor) {
      const Bitstream any{static_cast<std::uint8_t>(major), static_cast<std::uint8_t>(minor)};
      EXPECT_TRUE(is_supported(negotiate({{}, any}, kDefault))) << text_of(any);
      EXPECT_TRUE(is_supported(negotiate({any, {}}, kDefault))) << text_of(any);
    }
  }
}

template <typename T>
T decoded(const Bytes& datagram) {
  const auto request = decode_request(datagram);
  if (!request || !std::holds_alternative<T>(*request)) {
    ADD_FAILURE() << "another kind of request";
    return {};
  }
  return std::get<T>(*request);
}

ConnectRequest decoded_connect(const Bytes& datagram) { return decoded<ConnectRequest>(datagram); }

TEST(Request, ReadsEveryFormOfConnect) {
  const auto empty = decoded_connect(from_hex("0000 0000"));
  EXPECT_TRUE(empty.empty);
  EXPECT_FALSE(empty.versions.library);
  const auto without_versions = decoded_connect(ping());
  EXPECT_FALSE(without_versions.empty);
  EXPECT_EQ(without_versions.name, "Ping");
  EXPECT_FALSE(without_versions.versions.library);
  const auto old = decoded_connect(connect({3, 0}));
  EXPECT_EQ(old.name, "NatNetLib");
  EXPECT_EQ(old.versions.library, (Bitstream{3, 0}));
  EXPECT_FALSE(old.versions.wanted);
  const auto with_options = decoded_connect(connect({4, 1}, {2, 7}, true));
  EXPECT_EQ(with_options.versions.wanted, (Bitstream{2, 7}));
  EXPECT_TRUE(with_options.subscribed_data_only);
  Bytes longer = connect({4, 2}, {4, 2});
  longer.resize(longer.size() + 4);
  EXPECT_EQ(decoded_connect(longer).versions.wanted, (Bitstream{4, 2}));
  Bytes cut = connect({4, 1}, {2, 7});
  cut.pop_back();
  EXPECT_FALSE(decoded_connect(cut).versions.wanted) << "all options or none";
}

TEST(Request, ReadsCommandsOfAnyLengthUpToTheFirstNul) {
  Bytes longer = words("FrameRate");
  longer.push_back(std::byte{0});
  EXPECT_EQ(decoded<CommandRequest>(longer).text, "FrameRate");
  // Header 16, text 9, no NUL.
  const Bytes shorter = from_hex("0200 1000 4672616d6552617465");
  EXPECT_EQ(decoded<CommandRequest>(shorter).text, "FrameRate");
  Bytes payload;
  LittleEndianWriter(payload).text("GetProperty,,X").u8(0).text("rest");
  EXPECT_EQ(decoded<CommandRequest>(message(Message::kRequest, payload)).text, "GetProperty,,X");
}

TEST(Request, ReadsModelRequestsAndKeepAlivesOfEachLength) {
  EXPECT_EQ(decoded<ModelRequest>(from_hex("0400 0000")).types, ~0U);
  EXPECT_EQ(decoded<ModelRequest>(from_hex("0400 0100 00")).types, ~0U);
  EXPECT_EQ(decoded<ModelRequest>(from_hex("0400 0400 02000000")).types, 2U);
  EXPECT_TRUE(decoded<KeepAliveRequest>(from_hex("0a00 0000")).name.empty());
  EXPECT_TRUE(decoded<KeepAliveRequest>(from_hex("0a00 0100 00")).name.empty());
  const auto full =
      decoded<KeepAliveRequest>(message(Message::kKeepAlive, sender_block({4, 1}, "lab")));
  EXPECT_EQ(full.name, "lab");
  EXPECT_EQ(full.versions.library, (Bitstream{4, 1}));
}

TEST(Request, ReplacesControlCharactersInNamesAndCutsThem) {
  const auto name_of = [](const Bytes& payload) {
    return decoded_connect(message(Message::kConnect, payload)).name;
  };
  EXPECT_EQ(name_of(sender_block({3, 1}, "a\nb\x1b[31m")), "a\\x0ab\\x1b[31m");
  const std::string escaped = name_of(Bytes(264, std::byte{0xff}));
  EXPECT_EQ(escaped.size(), 64U + 3) << "of what is shown";
  EXPECT_TRUE(escaped.starts_with("\\xff\\xff"));
  EXPECT_TRUE(escaped.ends_with("\\xff..."));
  const Bytes longest(65503, std::byte{'n'});
  EXPECT_EQ(name_of(longest), std::string(64, 'n') + "...");
  EXPECT_EQ(decoded<CommandRequest>(message(Message::kRequest, longest)).text.size(),
            longest.size());
}

TEST(Request, RejectsMessagesOfServers) {
  for (const int id : {1, 3, 5, 7, 8, 11, 13, 15, 99, 100, 255, 256, 65535}) {
    EXPECT_FALSE(decode_request(message(static_cast<Message>(id)))) << id;
  }
}

TEST(Request, RejectsATruncatedEchoAndReadsATruncatedConnect) {
  // Captured between a commercial server and its library, 3.0.
  const Bytes echo = from_hex("0c000800 4e669a1000000000");
  EXPECT_EQ(decoded<EchoRequest>(echo).client_ticks, 278554190U);
  for (std::size_t n = 0; n < echo.size(); ++n)
    EXPECT_FALSE(decode_request(std::span(echo).first(n))) << n;
  const Bytes whole = connect({4, 1}, {4, 1});
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_EQ(decode_request(std::span(whole).first(n)).has_value(), n >= 4) << n;
}

const ServerInfo kInfo{{2, 1, 0, 7}, {3, 1}, 1511, true, {239, 255, 42, 99}};

std::string name_field() { return "46696475636170" + std::string(2 * (256 - 7), '0'); }

TEST(Answer, ServerInfoIsShorterBeforeVersion3) {
  EXPECT_EQ(to_hex(encode(kInfo)), to_hex(from_hex("0100 1701" + name_field() +
                                                   "02010007"              // application
                                                   "03010000"              // bitstream
                                                   "8096980000000000"      // 10 MHz
                                                   "e705 01 efff2a63")));  // port, multicast, group
  ServerInfo old = kInfo;
  old.bitstream = {2, 10};
  EXPECT_EQ(to_hex(encode(old)),
            to_hex(from_hex("0100 0801" + name_field() + "02010007 020a0000")));
}

TEST(Answer, IsEncodedAsByTheCommercialServer) {
  EXPECT_EQ(encode_response(120.0F), from_hex("03000400 0000f042"));
  EXPECT_EQ(encode_response(std::int32_t{0}), from_hex("03000400 00000000"));
  EXPECT_EQ(encode_text_response("/"), from_hex("03000200 2f00"));
  EXPECT_EQ(encode_bitstream_response({3, 1}), from_hex("03000f00 42697473747265616d2c332e312e30"));
  EXPECT_EQ(encode_unrecognized(), from_hex("6400 0000"));
  EXPECT_EQ(encode_echo(278554190, instant_from_ns(123'456'789'000)),
            from_hex("0d00 1000 4e669a1000000000 d2029649 00000000"));
  const auto longest = encode_text_response(std::string(70000, 'x'));
  EXPECT_EQ(longest.size(), kHeaderSize + 256) << "the buffer of clients";
  EXPECT_EQ(longest.back(), std::byte{0});
}

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

TEST(ModelEncoder, EncodesRequestedTypesInTheLayoutOfEachVersion) {
  const std::string kOffset = "000000000000000000000000";
  const std::string kArm = "61726d00 09000000 ffffffff" + kOffset;
  EXPECT_EQ(to_hex(encode_model(kTwo, ModelLayout::k2_5)),
            to_hex(from_hex("0500 3f00 02000000 01000000" + kArm + "01000000 6bc3a4666572 00" +
                            "0c000000 ffffffff" + kOffset)));
  struct Case {
    ModelLayout layout;
    std::string what, bytes;
  };
  const Case kCases[] = {
      {ModelLayout::k3_0, "no markers", "0500 2400 01000000 01000000" + kArm + "00000000"},
      {ModelLayout::k4_0, "no markers", "0500 2400 01000000 01000000" + kArm + "00000000"},
      {ModelLayout::k4_1, "with sizes", "0500 2800 01000000 01000000 1c000000" + kArm + "00000000"},
      {ModelLayout::k4_2, "rotation after the offset",
       "0500 3800 01000000 01000000 2c000000" + kArm +
           "0000000000000000000000000000803f 00000000"}};
  for (const auto& [layout, what, bytes] : kCases)
    EXPECT_EQ(to_hex(encode_model(std::span(kTwo).first(1), layout)), to_hex(from_hex(bytes)))
        << what;
  for (const Bitstream version : {Bitstream{4, 3}, Bitstream{4, 4}})
    EXPECT_EQ(model_layout(version), ModelLayout::k4_2) << text_of(version);
  EXPECT_EQ(encode_model(kTwo, ModelLayout::k4_1, 1U << 5), from_hex("0500 0400 00000000"));
  EXPECT_EQ(encode_model(kTwo, ModelLayout::k4_1, ModelRequest::kRigidBodies),
            encode_model(kTwo, ModelLayout::k4_1));
}

TEST(AnnouncedBodies, HaveNamesThatCommandsCanContain) {
  SceneModel model;
  model.bodies = {{1, "left,arm"}, {2, "left_arm"}, {3, "tab\there"}};
  const auto bodies = announced_bodies(model, kRule, {{"tab\there", "alias"}});
  EXPECT_EQ(bodies[0].name, "left_arm_2");
  EXPECT_EQ(bodies[1].name, "left_arm") << "a valid name stays";
  EXPECT_EQ(bodies[2].name, "alias");
  EXPECT_EQ(bodies[2].id, 3);
  EXPECT_EQ(announced_bodies(model_of(1, 65536), kRule).front().name.size(), kMaxName);
}

TEST(AnnouncedBodies, AThousandFitOneDatagramInEveryLayout) {
  const auto bodies = announced_bodies(model_of(1000, 255), kRule);
  ASSERT_EQ(bodies.size(), 1000U);
  std::set<std::string> names;
  for (const auto& body : bodies) EXPECT_TRUE(names.insert(body.name).second) << body.name;
  for (const auto layout : {ModelLayout::k2_5, ModelLayout::k3_0, ModelLayout::k4_0,
                            ModelLayout::k4_1, ModelLayout::k4_2}) {
    EXPECT_LE(encode_model(bodies, layout).size(), kMaxDatagram);
  }
  EXPECT_EQ(announced_bodies(model_of(1300, 6), kRule).size(), kMaxBodies);
}

TEST(AnnouncedBodies, KeepShortNamesOfAThousandBodies) {
  const auto model = model_of(1000, 12);
  const auto bodies = announced_bodies(model, kRule);
  for (std::size_t i = 0; i < bodies.size(); ++i) ASSERT_EQ(bodies[i].name, model.bodies[i].name);
}

}  // namespace
}  // namespace fiducap::natnet
