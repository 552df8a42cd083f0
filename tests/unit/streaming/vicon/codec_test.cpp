#include "streaming/vicon/codec.hpp"

#include <gmock/gmock.h>

#include <functional>
#include <numbers>

#include "base/pose.hpp"
#include "support/hex.hpp"

namespace fiducap::vicon {
namespace {

using testing::ElementsAre;
using testing::Pair;

// The bytes below are those that clients of the SDK 1.11 and 1.12 accepted or sent, see
// protocols/vicon.md section 11.

using Bytes = std::vector<std::byte>;

std::string hex(std::string_view text) { return to_hex(from_hex(text)); }

/// t = (1000, -250.5, 1200) mm, +90 degrees about z: x turns into y.
SegmentPose quarter_turn() {
  SegmentPose pose;
  pose.subject = 1;
  pose.t_mm = {1000, -250.5, 1200};
  pose.R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  pose.rotation_vector = {0, 0, std::numbers::pi / 2};
  return pose;
}

const std::array<NamedValue, 1> kOneValue{{{"Abc", 1.0}}};
const std::array<std::pair<Type, std::uint32_t>, 2> kCounts{
    {{Type::kStreamInfo, 0}, {Type::kGlobalSegments, 3}}};
const std::array<Type, 1> kUnchanged{Type::kStreamInfo};
constexpr char kSegmentBytes[] =  // rows of the matrix that turns segment into world
    " 6c000000  01000000 01000000 01000000"
    "0000000000408f40 0000000000506fc0 0000000000c09240"
    "0000000000000000 000000000000f0bf 0000000000000000"
    "000000000000f03f 0000000000000000 0000000000000000"
    "0000000000000000 0000000000000000 000000000000f03f";

struct Encoding {
  const char* what;
  std::function<void(Bytes&)> encode;
  std::string bytes;
};
const Encoding kEncodings[] = {
    {"greeting, all types ascending", encode_greeting,
     "01002b1a 4c000000  a1860100 44000000  10000000"
     "01000000 02000000 05000000 08000000 09000000 17000000 1a000000 1c000000"
     "24000000 25000000 27000000 28000000 2a000000 85030000 616d0000 a4860100"},
    {"pong of ping 1", [](Bytes& out) { encode_pong(1, out); },
     "01002b1a 10000000 2a000000 08000000 01000000 00000000"},
    {"pong of a long id", [](Bytes& out) { encode_pong(0x1122334455667788, out); },
     "01002b1a 10000000 2a000000 08000000 8877665544332211"},
    {"contents: counts of types, unchanged types",
     [](Bytes& out) { encode_contents(kCounts, kUnchanged, out); },
     "a4860100 1c000000  02000000 01000000 00000000 09000000 03000000  01000000 01000000"},
    {"100 Hz in ticks of 135 MHz", [](Bytes& out) { encode_stream_info(100, out); },
     "01000000 08000000 7099140000000000"},
    {"200 Hz in ticks of 135 MHz", [](Bytes& out) { encode_stream_info(200, out); },
     "01000000 08000000 b84c0a0000000000"},
    {"z up", encode_application_info, "25000000 01000000 00"},
    {"subject with one root segment of its name",
     [](Bytes& out) { encode_subject_info(1, "alpha", out); },
     "02000000 42000000  01000000 05000000 616c706861  01000000"
     "00000000 01000000 00000000 00000000 00000000 00000000 00000000 00000000 05000000 "
     "616c706861 00000000 00000000"},
    {"topology of a rigid body", [](Bytes& out) { encode_subject_topology(3, out); },
     "1c000000 6c000000  03000000 01000000 01000000"
     "0000000000000000 0000000000000000 0000000000000000"
     "000000000000f03f 0000000000000000 0000000000000000"
     "0000000000000000 000000000000f03f 0000000000000000"
     "0000000000000000 0000000000000000 000000000000f03f"},
    {"scale of a rigid body", [](Bytes& out) { encode_subject_scale(3, out); },
     "616d0000 24000000  03000000 01000000 01000000  000000000000f03f 000000000000f03f "
     "000000000000f03f"},
    {"frame number", [](Bytes& out) { encode_number(Type::kFrameInfo, 258, out); },
     "05000000 04000000 02010000"},
    {"hardware frame number", [](Bytes& out) { encode_number(Type::kHardwareFrameInfo, 7, out); },
     "24000000 04000000 07000000"},
    {"quality", [](Bytes& out) { encode_object_quality(2, 1.0, out); },
     "28000000 0c000000 02000000 000000000000f03f"},
    {"latency", [](Bytes& out) { encode_named(Type::kLatencyInfo, kOneValue, out); },
     "1a000000 13000000  01000000 03000000 416263 000000000000f03f"},
    {"rates", [](Bytes& out) { encode_named(Type::kFrameRateInfo, kOneValue, out); },
     "27000000 13000000  01000000 03000000 416263 000000000000f03f"},
    {"global segment",
     [](Bytes& out) { encode_segments(Type::kGlobalSegments, quarter_turn(), out); },
     std::string("09000000") + kSegmentBytes},
    {"local segment",
     [](Bytes& out) { encode_segments(Type::kLocalSegments, quarter_turn(), out); },
     std::string("08000000") + kSegmentBytes},
    {"lightweight segment: a rotation vector in floats",
     [](Bytes& out) { encode_lightweight_segments(quarter_turn(), out); },
     "85030000 24000000  01000000 01000000 01000000  00007a44 00807ac3 00009644  "
     "00000000 00000000 db0fc93f"},
    {"timecode",
     [](Bytes& out) {
       encode_timecode({22, 13, 20, 1, 2, 8}, out);
     },
     "17000000 11000000  16 0d 14 01 0200 0800 00000000 00000000 00"},
    {"packet with the length behind its header",
     [](Bytes& out) {
       const auto opened = open_packet(out);
       encode_number(Type::kFrameInfo, 1, out);
       close_packet(opened, out);
     },
     "01002b1a 0c000000 05000000 04000000 01000000"}};

TEST(ViconCodec, EncodesEveryObject) {
  for (const auto& [what, encode, bytes] : kEncodings) {
    Bytes out = from_hex("ee");  // encoders append
    encode(out);
    EXPECT_EQ(to_hex(out), hex("ee" + bytes)) << what;
  }
}

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;  // 2023-11-14 22:13:20 UTC

TEST(ViconCodec, TimecodeIsTheUtcTimeOfDayAt25FramesPerSecond) {
  EXPECT_EQ(timecode_of(kStart_ns, 100), (Timecode{22, 13, 20, 0, 0, 4}));
  EXPECT_EQ(timecode_of(kStart_ns + 999'999'999, 100), (Timecode{22, 13, 20, 24, 3, 4}));
  EXPECT_EQ(timecode_of(kStart_ns + 45'000'000, 200), (Timecode{22, 13, 20, 1, 1, 8}));
  EXPECT_EQ(timecode_of(kStart_ns + 80'000'000, 10), (Timecode{22, 13, 20, 2, 0, 1}));
  for (const double rate_hz : {60.0, 100.0, 200.0, 333.0, 1000.0}) {
    std::optional<Timecode> last;
    for (int i = 0; i < 2000; ++i) {
      const auto time = timecode_of(kStart_ns + std::llround(i * kSecond_ns / rate_hz), rate_hz);
      EXPECT_NE(last, time) << rate_hz << " Hz, frame " << i;
      EXPECT_LT(time.subframe, time.subframes_per_frame);
      EXPECT_LT(time.frames, 25);
      last = time;
    }
  }
}

/// Payload of the only object of a packet.
Bytes payload_of(std::string_view packet_hex) {
  const Bytes packet = from_hex(packet_hex);
  EXPECT_EQ(packet_size(packet).value_or(0), packet.size());
  std::span<const std::byte> objects = std::span(packet).subspan(kHeaderSize);
  const auto object = take_object(objects);
  EXPECT_TRUE(object);
  EXPECT_TRUE(objects.empty());
  return {object->payload.begin(), object->payload.end()};
}

TEST(ViconCodec, ReadsTheFirstTypesOfSdk112) {
  const auto types = decode_object_enums(payload_of(
      "01002b1a 34000000  a1860100 2c000000  0a000000"
      "01000000 02000000 05000000 17000000 1a000000 1d000000 25000000 27000000 28000000 a4860100"));
  ASSERT_TRUE(types);
  EXPECT_TRUE(types->has(Type::kSubjectInfo));
  EXPECT_TRUE(types->has(Type::kContents));
  EXPECT_FALSE(types->has(Type::kGlobalSegments));
  EXPECT_EQ(types->size(), 9u) << "subject health (29) is not offered";
}

TEST(ViconCodec, ReadsRequestsAndPings) {
  EXPECT_FALSE(*decode_request_frame(payload_of("01002b1a 09000000 a2860100 01000000 00")));
  EXPECT_TRUE(*decode_request_frame(payload_of("01002b1a 09000000 a2860100 01000000 01")));
  EXPECT_EQ(*decode_request_next_frame(payload_of("01002b1a 0c000000 a8860100 04000000 05000000")),
            5u);
  EXPECT_EQ(*decode_ping(payload_of("01002b1a 10000000 2a000000 08000000 0100000000000080")),
            0x8000000000000001u);
}

TEST(ViconCodec, ReadsAFilterWithoutTypesThatHaveNoSubject) {
  const auto filter = decode_filter(
      from_hex("03000000  09000000 03000000 05000000 02000000 05000000  10000000 01000000 07000000"
               "  28000000 00000000"));
  ASSERT_TRUE(filter) << filter.error().text();
  EXPECT_THAT(*filter, ElementsAre(Pair(Type::kGlobalSegments, ElementsAre(2u, 5u)),
                                   Pair(Type::kObjectQuality, ElementsAre())));
}

TEST(ViconCodec, RejectsAWrongTagAtItsFirstByteAndLengthsAboveTheLimit) {
  EXPECT_FALSE(packet_size(from_hex("47")));
  EXPECT_FALSE(packet_size(from_hex("01002b1b")));
  EXPECT_EQ(*packet_size(from_hex("01002b")), 0u);
  EXPECT_EQ(*packet_size(from_hex("01002b1a 000000")), 0u);
  EXPECT_EQ(*packet_size(from_hex("01002b1a 00000100")), 8 + kMaxClientPacket);
  EXPECT_EQ(packet_size(from_hex("01002b1a 01000100")).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(packet_size(from_hex("01002b1a ffffffff")).error().code, ErrorCode::kInvalid);
}

TEST(ViconCodec, RejectsEveryTruncationOfEveryPayload) {
  const auto rejected = [](const auto& decode, std::string_view text) {
    const Bytes whole = from_hex(text);
    EXPECT_TRUE(decode(whole));
    for (std::size_t n = 0; n < whole.size(); ++n) {
      EXPECT_FALSE(decode(std::span(whole).first(n))) << n << " of " << whole.size();
    }
  };
  rejected(decode_object_enums, "02000000 01000000 02000000");
  rejected(decode_filter, "02000000 09000000 01000000 05000000 28000000 01000000 05000000");
  rejected(decode_request_frame, "01");
  rejected(decode_request_next_frame, "01000000");
  rejected(decode_ping, "0100000000000000");
}

TEST(ViconCodec, RejectsCountsLargerThanThePayload) {
  EXPECT_EQ(decode_object_enums(from_hex("ffffffff 01000000")).error().code, ErrorCode::kTruncated);
  for (const char* text : {"ffffffff 01000000 00000000", "01000000 09000000 00000040"})
    EXPECT_EQ(decode_filter(from_hex(text)).error().code, ErrorCode::kTruncated) << text;
  const Bytes lying = from_hex("2a000000 ffffffff 01");
  std::span<const std::byte> objects = lying;
  EXPECT_EQ(take_object(objects).error().code, ErrorCode::kTruncated);
}

}  // namespace
}  // namespace fiducap::vicon
