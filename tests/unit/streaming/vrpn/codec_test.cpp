#include "streaming/vrpn/codec.hpp"

#include <gmock/gmock.h>

#include <map>

#include "connection_fixture.hpp"

namespace fiducap::vrpn {
namespace {

using testing::HasSubstr;

// Times of the recording.
constexpr std::int64_t kReported_ns = 1700000000'123456000;
constexpr std::uint32_t kAnswered_s = 0x6b014414;
constexpr std::uint32_t kAsked_s = 0x6b014416;

Header header(std::uint32_t s, std::uint32_t us, std::int32_t sender, std::int32_t type,
              std::uint32_t sequence) {
  return {std::int64_t{s} * 1'000'000'000 + std::int64_t{us} * 1000, sender, type, sequence};
}
Header report(Type type, std::uint32_t sequence) {
  return {kReported_ns, 1, static_cast<std::int32_t>(type), sequence};
}
Header answer(std::uint32_t us, Type type, std::uint32_t sequence) {
  return header(kAnswered_s, us, 1, static_cast<std::int32_t>(type), sequence);
}
void describe_type(Type type, std::uint32_t us, std::uint32_t sequence, Bytes& out) {
  const auto id = static_cast<std::int32_t>(type);
  encode_description(header(kAnswered_s, us, id, kTypeDescription, sequence),
                     kTypeNames[static_cast<std::size_t>(id)], out);
}

const Pose kPose{{0.9273618495495704, 0.1, 0.2, 0.3}, {1.25, -2.5, 0.75}};

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}

/// The recorded messages, encoded again, by their names.
std::map<std::string, Bytes> encoded_messages() {
  std::map<std::string, Bytes> out;
  const auto sender = [](std::uint32_t s, std::uint32_t us, std::int32_t id,
                         std::uint32_t sequence) {
    return header(s, us, id, kSenderDescription, sequence);
  };
  encode_description(sender(kAnswered_s, 0x6bd03, 0, 0), "VRPN Control", out["sender_control"]);
  encode_description(sender(kAnswered_s, 0x6bd03, 1, 1), "body1", out["sender_body1"]);
  encode_description(sender(kAsked_s, 0xa3a8d, 1, 6), "body1", out["client_sender_body1"]);
  describe_type(Type::kGotFirstConnection, 0x6bd04, 2, out["type_got_first_connection"]);
  describe_type(Type::kPosQuat, 0x6bd04, 6, out["type_pos_quat"]);
  describe_type(Type::kPong, 0x6bd05, 0x13, out["type_pong"]);
  encode_empty(answer(0x70c66, Type::kPong, 0x19), out["pong"]);
  encode_empty(header(kAsked_s, 0xa3b56, 1, 16, 0x1a), out["client_ping"]);
  encode_pos_quat(report(Type::kPosQuat, 0), 0, kPose, out["pos_quat_sensor_0"]);
  encode_pos_quat(report(Type::kPosQuat, 1), 1, kPose, out["pos_quat_sensor_1"]);
  encode_rate(report(Type::kVelocity, 2), 0, {0.5, -0.25, 0.125},
              {std::cos(0.5), 0, 0, std::sin(0.5)}, 1.0, out["velocity"]);
  encode_rate(report(Type::kAcceleration, 3), 0, {0, 0, -9.8125}, Eigen::Quaterniond::Identity(),
              1.0, out["acceleration"]);
  encode_to_room(answer(0x70c69, Type::kToRoom, 0x1a),
                 {Eigen::Quaterniond::Identity(), {0, 0, -0.28}}, out["to_room"]);
  encode_workspace(answer(0x70c73, Type::kWorkspace, 0x1d), {-0.2, -0.2, -0.1}, {0.2, 0.2, 0.2},
                   out["workspace"]);
  encode_unit_to_sensor(answer(0x70c6c, Type::kUnitToSensor, 0x1c), 1, Pose{},
                        out["unit_to_sensor"]);
  return out;
}

TEST(VrpnCodec, EncodesTheRecordedMessages) {
  for (const auto& [name, bytes] : encoded_messages()) EXPECT_EQ(bytes, golden(name)) << name;
}

TEST(VrpnCodec, CookieCarriesTheConfiguredMinorVersion) {
  Bytes out;
  encode_cookie(38, out);
  EXPECT_EQ(out, golden("cookie"));
  out.clear();
  encode_cookie(5, out);
  EXPECT_EQ(out, from_hex("7672706e3a207665722e2030372e3035 2020 30 0000000000"));
}

TEST(VrpnCodec, TextEqualsTheRecordedOneExceptForItsLength) {
  const Bytes recorded = golden("text_start");
  Bytes out;
  encode_text(report(Type::kText, 0x18), {Severity::kWarning, 3, "hello"}, out);
  ASSERT_EQ(out.size(), 24u + 16u);
  EXPECT_EQ(Bytes(out.begin(), out.begin() + 4),
            from_hex("00000026"));  // 24 + 8 + "hello\0", not 24 + 1032
  EXPECT_EQ(Bytes(out.begin() + 4, out.begin() + 38), Bytes(recorded.begin() + 4, recorded.end()));
  out.clear();
  encode_text({}, {Severity::kError, 0, std::string(5000, 'x')}, out);
  EXPECT_EQ(out.size(), 24u + 1032u) << "cut to the buffer of clients";
}

TEST(VrpnCodec, ReadsTheRecordedText) {
  Bytes recorded = golden("text_start");
  recorded.resize(24 + 1032);
  const auto message = decode_message(recorded);
  ASSERT_TRUE(message) << message.error().text();
  const auto text = decode_text(message->payload);
  ASSERT_TRUE(text) << text.error().text();
  EXPECT_EQ(text->severity, Severity::kWarning);
  EXPECT_EQ(text->level, 3u);
  EXPECT_EQ(text->text, "hello");
}

TEST(VrpnCodec, ReadsTheRecordedMessagesOfAClient) {
  EXPECT_EQ(decode_request(golden("request")).value_or(0), 32997);
  const Bytes bytes = golden("client_udp_description");
  const auto message = decode_message(bytes);
  ASSERT_TRUE(message) << message.error().text();
  EXPECT_EQ(message->header.type, kUdpDescription);
  EXPECT_EQ(message->size, bytes.size());
  EXPECT_EQ(decode_udp_description(*message).value_or(0), 46815);
  const Bytes ping = golden("client_ping");
  const auto pinged = decode_message(ping);
  ASSERT_TRUE(pinged) << pinged.error().text();
  EXPECT_EQ(pinged->header, header(kAsked_s, 0xa3b56, 1, 16, 0x1a));
  EXPECT_TRUE(pinged->payload.empty());
}

/// Copies of every beginning, each of its own size, so that a sanitizer sees every read past the
/// end. @param to  longest beginning
template <class Check>
void each_truncation(const Bytes& whole, std::size_t to, Check check) {
  for (std::size_t n = 0; n <= to; ++n)
    check(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)));
}

TEST(VrpnCodec, RejectsEveryTruncationOfARecordedMessage) {
  auto messages = encoded_messages();
  messages["client_udp_description"] = golden("client_udp_description");
  for (const auto& message : messages) {
    const std::string& name = message.first;
    const Bytes& bytes = message.second;
    ASSERT_TRUE(decode_message(bytes)) << name;
    each_truncation(bytes, bytes.size() - 1, [&](const Bytes& cut) {
      const auto decoded = decode_message(cut);
      ASSERT_FALSE(decoded) << name << " cut at " << cut.size();
      EXPECT_EQ(decoded.error().code, ErrorCode::kTruncated) << name;
      EXPECT_THAT(decoded.error().text(), HasSubstr("bytes at offset"));
    });
  }
}

TEST(VrpnCodec, RejectsEveryTruncationOfCookieRequestTextAndName) {
  ASSERT_TRUE(decode_cookie(golden("cookie")));
  const auto rejected = [](const Bytes& whole, std::size_t to, const auto& decode) {
    each_truncation(whole, to, [&](const Bytes& cut) { EXPECT_FALSE(decode(cut)) << cut.size(); });
  };
  const Bytes text = from_hex("00000001 00000003 68656c6c6f00");
  rejected(golden("cookie"), golden("cookie").size() - 1, decode_cookie);
  rejected(golden("request"), golden("request").size() - 1, decode_request);
  rejected(text, text.size() - 1, decode_text);
  rejected(from_hex("00000002 6100"), 4, decode_name);
}

TEST(VrpnCodec, RejectsInvalidLengths) {
  for (const char* length : {"00000000", "00000017", "ffffffff", "80000000", "0000fa19"}) {
    const auto size = occupied_size(from_hex(length));
    ASSERT_FALSE(size) << length;
    EXPECT_EQ(size.error().code, ErrorCode::kInvalid);
    EXPECT_THAT(size.error().what, HasSubstr("expected a length from 24 to 64024"));
  }
  EXPECT_EQ(*occupied_size(from_hex("0000fa18")), 64024u);
  EXPECT_EQ(*occupied_size(from_hex("00000019")), 32u);
  EXPECT_EQ(*occupied_size(from_hex("000000")), 0u);
}

TEST(VrpnCodec, AcceptsCookiesOfAnyMinorVersionOnly) {
  const auto cookie =
      decode_cookie(bytes_of(std::string_view("vrpn: ver. 07.31  3\0\xed\1\2\3", 24)));
  ASSERT_TRUE(cookie) << cookie.error().text();
  EXPECT_EQ(cookie->minor, 31);
  EXPECT_EQ(cookie->log_mode, 3);
  const auto error = [](const char* text) {
    return decode_cookie(bytes_of(std::string_view(text, 24))).error();
  };
  EXPECT_EQ(error("vrpn: ver. 06.38  0\0\0\0\0\0").code, ErrorCode::kUnsupported);
  EXPECT_THAT(error("vrpn: ver. 06.38  0\0\0\0\0\0").text(), HasSubstr("06.38"));
  EXPECT_EQ(error("vrpn: ver. 07.38  x\0\0\0\0\0").code, ErrorCode::kInvalid);
  EXPECT_EQ(error("GET / HTTP/1.1\r\nHost: a.b").code, ErrorCode::kInvalid);
}

TEST(VrpnCodec, RejectsInvalidRequests) {
  for (const char* text : {"127.0.0.1 1023", "127.0.0.1 65536", "127.0.0.1 99999999999",
                           "127.0.0.1", "127.0.0.1 ", " 4000", "127.0.0.1 40x0", "127.0.0.1  4000",
                           "a;rm 4000", "127.0.0.1 -4000", "127.0.0.1\t4000"}) {
    EXPECT_FALSE(decode_request(bytes_of(std::string(text) + '\0'))) << text;
  }
}

TEST(VrpnCodec, RejectsUdpPortsBelow1024AndInvalidAddresses) {
  const auto described = [](std::int32_t port, std::string_view address) {
    Message message;
    message.header.sender = port;
    message.payload = bytes_of(address);
    return decode_udp_description(message).has_value();
  };
  const std::string_view good("10.0.0.1\0", 9);
  EXPECT_TRUE(described(1024, good));
  for (const int port : {1023, -5, 70000}) EXPECT_FALSE(described(port, good)) << port;
  EXPECT_FALSE(described(5000, "10.0.0.1"));
  EXPECT_FALSE(described(5000, std::string_view("\0", 1)));
  EXPECT_FALSE(described(5000, std::string_view("evil.example\0", 13)));
}

TEST(VrpnCodec, ReadsNamesOfWrongLengthAndRejectsEmptyAndLongOnes) {
  EXPECT_EQ(*decode_name(from_hex("0000000a 626f647931 00")), "body1");  // vrpn-rs: 4 too large
  EXPECT_EQ(*decode_name(from_hex("00000005 626f647931")), "body1");     // no zero byte
  EXPECT_EQ(*decode_name(from_hex("00000006 626f647931 00 0000")), "body1");  // padding counted
  EXPECT_FALSE(decode_name(from_hex("00000001 00")));
  Bytes longest(4 + 64000 - 4, std::byte{'a'});
  EXPECT_FALSE(decode_name(longest));
  EXPECT_TRUE(decode_name(std::span(longest).first(104)));
  EXPECT_FALSE(decode_name(std::span(longest).first(105)));
}

TEST(VrpnCodec, NumbersMessagesOfDifferentSizes) {
  Bytes out;
  encode_empty({}, out);
  encode_description({}, "x", out);
  encode_pos_quat({}, 0, Pose{}, out);
  std::uint32_t next = 0xfffffffe;
  number_messages(out, next);
  EXPECT_EQ(next, 1u);  // wraps
  std::vector<std::uint32_t> numbers;
  for (const auto& sent : split(out)) numbers.push_back(sent.header.sequence);
  EXPECT_THAT(numbers, testing::ElementsAre(0xfffffffeu, 0xffffffffu, 0u));
}

}  // namespace
}  // namespace fiducap::vrpn
