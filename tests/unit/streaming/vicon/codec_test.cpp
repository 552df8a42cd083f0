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

using Encode = std::function<void(std::vector<std::byte>&)>;

std::string encoded(const Encode& encode) {
  std::vector<std::byte> out{std::byte{0xee}};  // encoders append
  encode(out);
  return to_hex({out.begin() + 1, out.end()});
}

std::string hex(std::string_view text) { return to_hex(from_hex(text)); }

TEST(ViconCodec, GreetsWithAllTypesAscending) {
  EXPECT_EQ(encoded(encode_greeting),
            hex("01002b1a 4c000000  a1860100 44000000  10000000"
                "01000000 02000000 05000000 08000000 09000000 17000000 1a000000 1c000000"
                "24000000 25000000 27000000 28000000 2a000000 85030000 616d0000 a4860100"));
}

TEST(ViconCodec, AnswersAPingWithItsOwnId) {
  EXPECT_EQ(encoded([](auto& out) { encode_pong(1, out); }),
            hex("01002b1a 10000000 2a000000 08000000 01000000 00000000"));
  EXPECT_EQ(encoded([](auto& out) { encode_pong(0x1122334455667788, out); }),
            hex("01002b1a 10000000 2a000000 08000000 8877665544332211"));
}

TEST(ViconCodec, ContentsCountTypesAndNameTheUnchangedOnes) {
  const std::array<std::pair<Type, std::uint32_t>, 2> counts{
      {{Type::kStreamInfo, 0}, {Type::kGlobalSegments, 3}}};
  const std::array<Type, 1> unchanged{Type::kStreamInfo};
  EXPECT_EQ(
      encoded([&](auto& out) { encode_contents(counts, unchanged, out); }),
      hex("a4860100 1c000000  02000000 01000000 00000000 09000000 03000000  01000000 01000000"));
}

TEST(ViconCodec, StreamInfoIsThePeriodInTicksOf135MHz) {
  EXPECT_EQ(encoded([](auto& out) { encode_stream_info(100, out); }),
            hex("01000000 08000000 7099140000000000"));
  EXPECT_EQ(encoded([](auto& out) { encode_stream_info(200, out); }),
            hex("01000000 08000000 b84c0a0000000000"));
}

TEST(ViconCodec, DeclaresZUp) {
  EXPECT_EQ(encoded(encode_application_info), hex("25000000 01000000 00"));
}

TEST(ViconCodec, SubjectInfoHasOneRootSegmentOfTheSameName) {
  EXPECT_EQ(encoded([](auto& out) { encode_subject_info(1, "alpha", out); }),
            hex("02000000 42000000  01000000 05000000 616c706861  01000000"
                "00000000 01000000 00000000 00000000 00000000 00000000 00000000 00000000 05000000 "
                "616c706861"
                "00000000 00000000"));
}

TEST(ViconCodec, TopologyAndScaleAreThoseOfARigidBody) {
  EXPECT_EQ(encoded([](auto& out) { encode_subject_topology(3, out); }),
            hex("1c000000 6c000000  03000000 01000000 01000000"
                "0000000000000000 0000000000000000 0000000000000000"
                "000000000000f03f 0000000000000000 0000000000000000"
                "0000000000000000 000000000000f03f 0000000000000000"
                "0000000000000000 0000000000000000 000000000000f03f"));
  EXPECT_EQ(encoded([](auto& out) { encode_subject_scale(3, out); }),
            hex("616d0000 24000000  03000000 01000000 01000000  000000000000f03f 000000000000f03f "
                "000000000000f03f"));
}

TEST(ViconCodec, NumbersAndQuality) {
  EXPECT_EQ(encoded([](auto& out) { encode_frame_info(258, out); }),
            hex("05000000 04000000 02010000"));
  EXPECT_EQ(encoded([](auto& out) { encode_hardware_frame_info(7, out); }),
            hex("24000000 04000000 07000000"));
  EXPECT_EQ(encoded([](auto& out) { encode_object_quality(2, 1.0, out); }),
            hex("28000000 0c000000 02000000 000000000000f03f"));
}

TEST(ViconCodec, LatencyAndRatesAreNamedDoubles) {
  const std::array<NamedValue, 1> one{{{"Abc", 1.0}}};
  EXPECT_EQ(encoded([&](auto& out) { encode_latency_info(one, out); }),
            hex("1a000000 13000000  01000000 03000000 416263 000000000000f03f"));
  EXPECT_EQ(encoded([&](auto& out) { encode_frame_rate_info(one, out); }),
            hex("27000000 13000000  01000000 03000000 416263 000000000000f03f"));
}

/// t = (1000, -250.5, 1200) mm, +90 degrees about z: x turns into y.
SegmentPose quarter_turn() {
  SegmentPose pose;
  pose.subject = 1;
  pose.t_mm = {1000, -250.5, 1200};
  pose.R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  pose.rotation_vector = {0, 0, std::numbers::pi / 2};
  return pose;
}

TEST(ViconCodec, SegmentsAreRowsOfTheMatrixThatTurnsSegmentIntoWorld) {
  const std::string payload =
      " 6c000000  01000000 01000000 01000000"
      "0000000000408f40 0000000000506fc0 0000000000c09240"
      "0000000000000000 000000000000f0bf 0000000000000000"
      "000000000000f03f 0000000000000000 0000000000000000"
      "0000000000000000 0000000000000000 000000000000f03f";
  EXPECT_EQ(encoded([](auto& out) { encode_segments(Type::kGlobalSegments, quarter_turn(), out); }),
            hex("09000000" + payload));
  EXPECT_EQ(encoded([](auto& out) { encode_segments(Type::kLocalSegments, quarter_turn(), out); }),
            hex("08000000" + payload));
}

TEST(ViconCodec, LightweightSegmentsAreARotationVectorInFloats) {
  EXPECT_EQ(encoded([](auto& out) { encode_lightweight_segments(quarter_turn(), out); }),
            hex("85030000 24000000  01000000 01000000 01000000  00007a44 00807ac3 00009644  "
                "00000000 00000000 db0fc93f"));
}

TEST(ViconCodec, APacketsLengthIsWhatStandsBehindItsHeader) {
  std::vector<std::byte> out = from_hex("ee");
  const auto opened = open_packet(out);
  encode_frame_info(1, out);
  close_packet(opened, out);
  EXPECT_EQ(to_hex(out), hex("ee 01002b1a 0c000000 05000000 04000000 01000000"));
}

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kNoonUtc_ns = 1'700'000'000'000'000'000;  // 2023-11-14 22:13:20 UTC

TEST(ViconCodec, TimecodeIsTheUtcTimeOfDayAt25FramesPerSecond) {
  EXPECT_EQ(timecode_of(kNoonUtc_ns, 100), (Timecode{22, 13, 20, 0, 0, 4}));
  EXPECT_EQ(timecode_of(kNoonUtc_ns + 999'999'999, 100), (Timecode{22, 13, 20, 24, 3, 4}));
  EXPECT_EQ(timecode_of(kNoonUtc_ns + 45'000'000, 200), (Timecode{22, 13, 20, 1, 1, 8}));
  EXPECT_EQ(timecode_of(kNoonUtc_ns + 80'000'000, 10), (Timecode{22, 13, 20, 2, 0, 1}));
  EXPECT_EQ(encoded([](auto& out) {
              encode_timecode({22, 13, 20, 1, 2, 8}, out);
            }),
            hex("17000000 11000000  16 0d 14 01 0200 0800 00000000 00000000 00"));
}

TEST(ViconCodec, EveryFrameOfTheStreamHasATimecodeOfItsOwn) {
  for (const double rate_hz : {60.0, 100.0, 200.0, 333.0, 1000.0}) {
    std::optional<Timecode> last;
    for (int i = 0; i < 2000; ++i) {
      const auto time = timecode_of(kNoonUtc_ns + std::llround(i * kSecond_ns / rate_hz), rate_hz);
      EXPECT_NE(last, time) << rate_hz << " Hz, frame " << i;
      EXPECT_LT(time.subframe, time.subframes_per_frame);
      EXPECT_LT(time.frames, 25);
      last = time;
    }
  }
}

Object only_object(const std::vector<std::byte>& packet) {
  const auto size = packet_size(packet);
  EXPECT_TRUE(size);
  EXPECT_EQ(*size, packet.size());
  std::span<const std::byte> objects = std::span(packet).subspan(kHeaderSize);
  const auto object = take_object(objects);
  EXPECT_TRUE(object);
  EXPECT_TRUE(objects.empty());
  return *object;
}

TEST(ViconCodec, ReadsTheFirstTypesOfSdk112) {
  const auto packet = from_hex(
      "01002b1a 34000000  a1860100 2c000000  0a000000"
      "01000000 02000000 05000000 17000000 1a000000 1d000000 25000000 27000000 28000000 a4860100");
  const auto types = decode_object_enums(only_object(packet).payload);
  ASSERT_TRUE(types);
  EXPECT_TRUE(types->has(Type::kSubjectInfo));
  EXPECT_TRUE(types->has(Type::kContents));
  EXPECT_FALSE(types->has(Type::kGlobalSegments));
  EXPECT_EQ(types->size(), 9u) << "subject health (29) is not offered";
}

TEST(ViconCodec, ReadsRequestsAndPings) {
  EXPECT_FALSE(*decode_request_frame(
      only_object(from_hex("01002b1a 09000000 a2860100 01000000 00")).payload));
  EXPECT_TRUE(*decode_request_frame(
      only_object(from_hex("01002b1a 09000000 a2860100 01000000 01")).payload));
  EXPECT_EQ(*decode_request_next_frame(
                only_object(from_hex("01002b1a 0c000000 a8860100 04000000 05000000")).payload),
            5u);
  EXPECT_EQ(
      *decode_ping(
          only_object(from_hex("01002b1a 10000000 2a000000 08000000 0100000000000080")).payload),
      0x8000000000000001u);
}

TEST(ViconCodec, ReadsAFilterAndLeavesOutWhatItCannotConcern) {
  const auto payload = from_hex(
      "03000000  09000000 03000000 05000000 02000000 05000000  10000000 01000000 07000000  "
      "28000000 00000000");
  const auto filter = decode_filter(payload);
  ASSERT_TRUE(filter) << filter.error().text();
  EXPECT_THAT(*filter, ElementsAre(Pair(Type::kGlobalSegments, ElementsAre(2u, 5u)),
                                   Pair(Type::kObjectQuality, ElementsAre())));
}

TEST(ViconCodec, RefusesAnotherTagAsSoonAsItShows) {
  EXPECT_FALSE(packet_size(from_hex("47")));
  EXPECT_FALSE(packet_size(from_hex("01002b1b")));
  EXPECT_EQ(*packet_size(from_hex("01002b")), 0u);
  EXPECT_EQ(*packet_size(from_hex("01002b1a 000000")), 0u);
}

TEST(ViconCodec, RefusesLengthsAboveTheLimit) {
  EXPECT_EQ(*packet_size(from_hex("01002b1a 00000100")), 8 + kMaxClientPacket);
  EXPECT_EQ(packet_size(from_hex("01002b1a 01000100")).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(packet_size(from_hex("01002b1a ffffffff")).error().code, ErrorCode::kInvalid);
}

TEST(ViconCodec, RefusesEveryTruncationOfEveryPayload) {
  const auto types = from_hex("02000000 01000000 02000000");
  const auto filter = from_hex("02000000 09000000 01000000 05000000 28000000 01000000 05000000");
  const auto refused = [](const auto& decode, const std::vector<std::byte>& whole) {
    EXPECT_TRUE(decode(whole));
    for (std::size_t n = 0; n < whole.size(); ++n) {
      EXPECT_FALSE(decode(std::span(whole).first(n))) << n << " of " << whole.size();
    }
  };
  refused(decode_object_enums, types);
  refused(decode_filter, filter);
  refused(decode_request_frame, from_hex("01"));
  refused(decode_request_next_frame, from_hex("01000000"));
  refused(decode_ping, from_hex("0100000000000000"));
}

TEST(ViconCodec, BelievesNoCountThatTheBytesCannotHold) {
  EXPECT_EQ(decode_object_enums(from_hex("ffffffff 01000000")).error().code, ErrorCode::kTruncated);
  EXPECT_EQ(decode_filter(from_hex("ffffffff 01000000 00000000")).error().code,
            ErrorCode::kTruncated);
  EXPECT_EQ(decode_filter(from_hex("01000000 09000000 00000040")).error().code,
            ErrorCode::kTruncated);
  const std::vector<std::byte> lying = from_hex("2a000000 ffffffff 01");
  std::span<const std::byte> objects = lying;
  EXPECT_EQ(take_object(objects).error().code, ErrorCode::kTruncated);
}

}  // namespace
}  // namespace fiducap::vicon
