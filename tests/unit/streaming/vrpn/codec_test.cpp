#include "streaming/vrpn/codec.hpp"

#include <gtest/gtest.h>

#include <random>

#include "golden.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::vrpn {
namespace {

using Bytes = std::vector<std::byte>;

// Times of the recording.
constexpr std::int64_t kReported_ns = 1700000000'123456000;
constexpr std::int64_t utc_ns(std::uint32_t seconds, std::uint32_t microseconds) {
  return std::int64_t{seconds} * 1'000'000'000 + std::int64_t{microseconds} * 1000;
}
constexpr std::int64_t kAnswered_s = 0x6b014414;

Header header(std::int64_t utc, std::int32_t sender, std::int32_t type, std::uint32_t sequence) {
  return {utc, sender, type, sequence};
}
Header report(Type type, std::uint32_t sequence) {
  return {kReported_ns, 1, static_cast<std::int32_t>(type), sequence};
}
Header answer(std::uint32_t microseconds, Type type, std::uint32_t sequence) {
  return {utc_ns(kAnswered_s, microseconds), 1, static_cast<std::int32_t>(type), sequence};
}

const Pose kPose{{0.9273618495495704, 0.1, 0.2, 0.3}, {1.25, -2.5, 0.75}};

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}

std::vector<std::string> framed() {
  return {"client_udp_description",
          "sender_control",
          "sender_body1",
          "type_got_first_connection",
          "type_pos_quat",
          "type_pong",
          "client_sender_body1",
          "client_ping",
          "pong",
          "pos_quat_sensor_0",
          "pos_quat_sensor_1",
          "velocity",
          "acceleration",
          "to_room",
          "workspace",
          "unit_to_sensor"};
}

TEST(VrpnCodec, CookieMatchesRecordedBytes) {
  Bytes out;
  encode_cookie(38, out);
  EXPECT_EQ(out, golden("cookie"));
}

TEST(VrpnCodec, CookieCarriesTheConfiguredMinorVersion) {
  Bytes out;
  encode_cookie(5, out);
  EXPECT_EQ(out, from_hex("7672706e3a207665722e2030372e3035 2020 30 0000000000"));
}

TEST(VrpnCodec, DescriptionsMatchRecordedBytes) {
  Bytes out;
  encode_description(header(utc_ns(kAnswered_s, 0x6bd03), 0, kSenderDescription, 0), "VRPN Control",
                     out);
  EXPECT_EQ(out, golden("sender_control"));
  out.clear();
  encode_description(header(utc_ns(kAnswered_s, 0x6bd03), 1, kSenderDescription, 1), "body1", out);
  EXPECT_EQ(out, golden("sender_body1"));
  out.clear();
  encode_description(header(utc_ns(0x6b014416, 0xa3a8d), 1, kSenderDescription, 6), "body1", out);
  EXPECT_EQ(out, golden("client_sender_body1"));
}

TEST(VrpnCodec, TypeNamesStandAtTheirRecordedIds) {
  const auto described = [](Type type, std::uint32_t microseconds, std::uint32_t sequence) {
    const auto id = static_cast<std::int32_t>(type);
    Bytes out;
    encode_description(header(utc_ns(kAnswered_s, microseconds), id, kTypeDescription, sequence),
                       kTypeNames[static_cast<std::size_t>(id)], out);
    return out;
  };
  EXPECT_EQ(described(Type::kGotFirstConnection, 0x6bd04, 2), golden("type_got_first_connection"));
  EXPECT_EQ(described(Type::kPosQuat, 0x6bd04, 6), golden("type_pos_quat"));
  EXPECT_EQ(described(Type::kPong, 0x6bd05, 0x13), golden("type_pong"));
}

TEST(VrpnCodec, PingAndPongMatchRecordedBytes) {
  Bytes out;
  encode_empty(answer(0x70c66, Type::kPong, 0x19), out);
  EXPECT_EQ(out, golden("pong"));
  out.clear();
  encode_empty(header(utc_ns(0x6b014416, 0xa3b56), 1, static_cast<std::int32_t>(Type::kPing), 0x1a),
               out);
  EXPECT_EQ(out, golden("client_ping"));
}

TEST(VrpnCodec, PosQuatMatchesRecordedBytes) {
  Bytes out;
  encode_pos_quat(report(Type::kPosQuat, 0), 0, kPose, out);
  EXPECT_EQ(out, golden("pos_quat_sensor_0"));
  out.clear();
  encode_pos_quat(report(Type::kPosQuat, 1), 1, kPose, out);
  EXPECT_EQ(out, golden("pos_quat_sensor_1"));
}

TEST(VrpnCodec, VelocityAndAccelerationMatchRecordedBytes) {
  Bytes out;
  encode_rate(report(Type::kVelocity, 2), 0, {0.5, -0.25, 0.125},
              {std::cos(0.5), 0, 0, std::sin(0.5)}, 1.0, out);
  EXPECT_EQ(out, golden("velocity"));
  out.clear();
  encode_rate(report(Type::kAcceleration, 3), 0, {0, 0, -9.8125}, Eigen::Quaterniond::Identity(),
              1.0, out);
  EXPECT_EQ(out, golden("acceleration"));
}

TEST(VrpnCodec, AnswersMatchRecordedBytes) {
  Bytes out;
  encode_to_room(answer(0x70c69, Type::kToRoom, 0x1a),
                 {Eigen::Quaterniond::Identity(), {0, 0, -0.28}}, out);
  EXPECT_EQ(out, golden("to_room"));
  out.clear();
  encode_workspace(answer(0x70c73, Type::kWorkspace, 0x1d), {-0.2, -0.2, -0.1}, {0.2, 0.2, 0.2},
                   out);
  EXPECT_EQ(out, golden("workspace"));
  out.clear();
  encode_unit_to_sensor(answer(0x70c6c, Type::kUnitToSensor, 0x1c), 1, Pose{}, out);
  EXPECT_EQ(out, golden("unit_to_sensor"));
}

TEST(VrpnCodec, TextMatchesRecordedBytesButForItsLength) {
  const Bytes recorded = golden("text_start");
  Bytes out;
  encode_text(report(Type::kText, 0x18), {Severity::kWarning, 3, "hello"}, out);
  ASSERT_EQ(out.size(), 24u + 16u);
  EXPECT_EQ(Bytes(out.begin(), out.begin() + 4),
            from_hex("00000026"));  // 24 + 8 + "hello\0", not 24 + 1032
  EXPECT_EQ(Bytes(out.begin() + 4, out.begin() + 38), Bytes(recorded.begin() + 4, recorded.end()));
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

TEST(VrpnCodec, CutsTextsAtWhatAClientCanHold) {
  Bytes out;
  encode_text({}, {Severity::kError, 0, std::string(5000, 'x')}, out);
  EXPECT_EQ(out.size(), 24u + 1032u);
}

TEST(VrpnCodec, ReadsTheRecordedRequest) {
  const auto port = decode_request(golden("request"));
  ASSERT_TRUE(port) << port.error().text();
  EXPECT_EQ(*port, 32997);
}

TEST(VrpnCodec, ReadsTheRecordedUdpDescription) {
  const Bytes bytes = golden("client_udp_description");
  const auto message = decode_message(bytes);
  ASSERT_TRUE(message) << message.error().text();
  EXPECT_EQ(message->header.type, kUdpDescription);
  EXPECT_EQ(message->size, bytes.size());
  const auto port = decode_udp_description(*message);
  ASSERT_TRUE(port) << port.error().text();
  EXPECT_EQ(*port, 46815);
}

TEST(VrpnCodec, ReadsHeadersOfRecordedMessages) {
  const Bytes bytes = golden("client_ping");
  const auto message = decode_message(bytes);
  ASSERT_TRUE(message) << message.error().text();
  EXPECT_EQ(message->header, header(utc_ns(0x6b014416, 0xa3b56), 1, 16, 0x1a));
  EXPECT_TRUE(message->payload.empty());
}

TEST(VrpnCodec, EveryTruncationOfARecordedMessageIsAnError) {
  for (const auto& name : framed()) {
    const Bytes bytes = golden(name);
    ASSERT_TRUE(decode_message(bytes)) << name;
    for (std::size_t n = 0; n < bytes.size(); ++n) {
      // A copy of its own size, so that a sanitizer sees every read past the end.
      const Bytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n));
      const auto message = decode_message(cut);
      ASSERT_FALSE(message) << name << " cut at " << n;
      EXPECT_EQ(message.error().code, ErrorCode::kTruncated) << name;
      EXPECT_NE(message.error().text().find("bytes at offset"), std::string::npos)
          << message.error().text();
    }
  }
}

TEST(VrpnCodec, EveryTruncationOfACookieIsAnError) {
  const Bytes cookie = golden("cookie");
  ASSERT_TRUE(decode_cookie(cookie));
  for (std::size_t n = 0; n < cookie.size(); ++n) {
    const Bytes cut(cookie.begin(), cookie.begin() + static_cast<std::ptrdiff_t>(n));
    ASSERT_FALSE(decode_cookie(cut)) << n;
  }
}

TEST(VrpnCodec, EveryTruncationOfARequestIsAnError) {
  const Bytes request = golden("request");
  for (std::size_t n = 0; n < request.size(); ++n) {
    const Bytes cut(request.begin(), request.begin() + static_cast<std::ptrdiff_t>(n));
    ASSERT_FALSE(decode_request(cut)) << n;
  }
}

TEST(VrpnCodec, EveryTruncationOfATextOrNamePrefixIsAnError) {
  const Bytes text = from_hex("00000001 00000003 68656c6c6f00");
  for (std::size_t n = 0; n < text.size(); ++n) {
    const Bytes cut(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(n));
    ASSERT_FALSE(decode_text(cut)) << n;
  }
  const Bytes name = from_hex("00000002 6100");
  for (std::size_t n = 0; n <= 4; ++n) {
    const Bytes cut(name.begin(), name.begin() + static_cast<std::ptrdiff_t>(n));
    ASSERT_FALSE(decode_name(cut)) << n;
  }
}

TEST(VrpnCodec, RefusesAbsurdLengths) {
  for (const char* length : {"00000000", "00000017", "ffffffff", "80000000", "0000fa19"}) {
    const auto size = occupied_size(from_hex(length));
    ASSERT_FALSE(size) << length;
    EXPECT_EQ(size.error().code, ErrorCode::kInvalid);
    EXPECT_NE(size.error().what.find("expected a length from 24 to 64024"), std::string::npos);
  }
  EXPECT_EQ(*occupied_size(from_hex("0000fa18")), 64024u);
  EXPECT_EQ(*occupied_size(from_hex("00000019")), 32u);
  EXPECT_EQ(*occupied_size(from_hex("000000")), 0u);
}

TEST(VrpnCodec, AcceptsAnyMinorVersionLogModeAndTail) {
  const auto cookie =
      decode_cookie(bytes_of(std::string_view("vrpn: ver. 07.31  3\0\xed\1\2\3", 24)));
  ASSERT_TRUE(cookie) << cookie.error().text();
  EXPECT_EQ(cookie->minor, 31);
  EXPECT_EQ(cookie->log_mode, 3);
}

TEST(VrpnCodec, RefusesOtherCookies) {
  const auto code = [](std::string_view text) {
    return decode_cookie(bytes_of(text)).error().code;
  };
  EXPECT_EQ(code(std::string_view("vrpn: ver. 06.38  0\0\0\0\0\0", 24)), ErrorCode::kUnsupported);
  EXPECT_EQ(code(std::string_view("vrpn: ver. 07.38  x\0\0\0\0\0", 24)), ErrorCode::kInvalid);
  EXPECT_EQ(code(std::string_view("GET / HTTP/1.1\r\nHost: a.b", 24)), ErrorCode::kInvalid);
  EXPECT_NE(decode_cookie(bytes_of(std::string_view("vrpn: ver. 06.38  0\0\0\0\0\0", 24)))
                .error()
                .text()
                .find("06.38"),
            std::string::npos);
}

TEST(VrpnCodec, RefusesRequestsOutsideTheRules) {
  for (const std::string_view text :
       {"127.0.0.1 1023", "127.0.0.1 65536", "127.0.0.1 99999999999", "127.0.0.1", "127.0.0.1 ",
        " 4000", "127.0.0.1 40x0", "127.0.0.1  4000", "a;rm 4000", "127.0.0.1 -4000",
        "127.0.0.1\t4000"}) {
    std::string datagram(text);
    datagram += '\0';
    EXPECT_FALSE(decode_request(bytes_of(datagram))) << text;
  }
}

TEST(VrpnCodec, RefusesUdpPortsBelow1024AndStrangeAddresses) {
  const auto described = [](std::int32_t port, std::string_view address) {
    Message message;
    message.header.sender = port;
    message.payload = bytes_of(address);
    return decode_udp_description(message).has_value();
  };
  EXPECT_TRUE(described(1024, std::string_view("10.0.0.1\0", 9)));
  EXPECT_FALSE(described(1023, std::string_view("10.0.0.1\0", 9)));
  EXPECT_FALSE(described(-5, std::string_view("10.0.0.1\0", 9)));
  EXPECT_FALSE(described(70000, std::string_view("10.0.0.1\0", 9)));
  EXPECT_FALSE(described(5000, "10.0.0.1"));
  EXPECT_FALSE(described(5000, std::string_view("\0", 1)));
  EXPECT_FALSE(described(5000, std::string_view("evil.example\0", 13)));
}

TEST(VrpnCodec, ReadsNamesWhoseLengthIsWrong) {
  EXPECT_EQ(*decode_name(from_hex("0000000a 626f647931 00")), "body1");  // vrpn-rs: 4 too large
  EXPECT_EQ(*decode_name(from_hex("00000005 626f647931")), "body1");     // no zero byte
  EXPECT_EQ(*decode_name(from_hex("00000006 626f647931 00 0000")), "body1");  // padding counted
}

TEST(VrpnCodec, RefusesEmptyAndEndlessNames) {
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
  std::span<const std::byte> rest(out);
  for (const std::uint32_t expected : {0xfffffffeu, 0xffffffffu, 0u}) {
    const auto message = decode_message(rest);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->header.sequence, expected);
    rest = rest.subspan(message->size);
  }
  EXPECT_TRUE(rest.empty());
}

TEST(VrpnCodec, SurvivesRandomBytes) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> byte(0, 255);
  std::uniform_int_distribution<int> length(0, 120);
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes(static_cast<std::size_t>(length(random)));
    for (auto& b : bytes) b = static_cast<std::byte>(byte(random));
    if (bytes.size() >= 4)
      bytes[0] = bytes[1] = bytes[2] = std::byte{0};  // a length that may be fulfilled
    if (const auto message = decode_message(bytes)) {
      ASSERT_LE(message->size, bytes.size());
      ASSERT_LE(message->payload.size() + 24, message->size);
      (void)decode_udp_description(*message);
    }
    (void)decode_cookie(bytes);
    (void)decode_name(bytes);
    (void)decode_text(bytes);
    (void)decode_request(bytes);
  }
}

TEST(VrpnCodec, EncodingIntoAWarmVectorAllocatesNothing) {
  Bytes out;
  const auto encode_all = [&] {
    out.clear();
    encode_pos_quat({}, 0, kPose, out);
    encode_rate({}, 0, kPose.p, kPose.q, 1.0, out);
    encode_empty({}, out);
    encode_text({}, {Severity::kNormal, 0, "hello"}, out);
    std::uint32_t next = 0;
    number_messages(out, next);
  };
  encode_all();
  const AllocationCounter allocations;
  encode_all();
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap::vrpn
