#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "streaming/qualisys/codec.hpp"
#include "support/hex.hpp"

namespace fiducap::qualisys {
namespace {

constexpr auto kLittle = std::endian::little;
constexpr auto kBig = std::endian::big;

// The vendor's C++ SDK 1.28 sends `Version 1.28` in these bytes on the little-endian port.
constexpr char kVersionCommand[] = "15000000 01000000 56657273696f6e20312e323800";

TEST(QualisysCodec, ReadsWhatTheVendorsSdkSends) {
  const auto bytes = from_hex(kVersionCommand);
  const auto packet = decode_packet(kLittle, bytes);
  ASSERT_TRUE(packet && *packet);
  EXPECT_EQ((*packet)->type, PacketType::kCommand);
  EXPECT_EQ((*packet)->size, bytes.size());
  EXPECT_EQ(decode_text((*packet)->payload), "Version 1.28");
}

TEST(QualisysCodec, WaitsForTheRestOfEveryTruncation) {
  const auto bytes = from_hex(kVersionCommand);
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    const auto packet = decode_packet(kLittle, std::span(bytes).first(n));
    ASSERT_TRUE(packet) << n;
    EXPECT_FALSE(*packet) << n;
  }
}

TEST(QualisysCodec, TakesTextWithoutItsZero) {
  const auto bytes = from_hex("0000000b 00000001 4e6577");
  const auto packet = decode_packet(kBig, bytes);
  ASSERT_TRUE(packet && *packet);
  EXPECT_EQ(decode_text((*packet)->payload), "New");
}

TEST(QualisysCodec, RefusesSizesThatCannotBe) {
  EXPECT_FALSE(decode_packet(kLittle, from_hex("07000000 01000000")));
  EXPECT_FALSE(decode_packet(kLittle, from_hex("ffffffff 01000000")));
  EXPECT_FALSE(decode_packet(kLittle, from_hex("01000100 01000000")));  // one more than the limit
  EXPECT_TRUE(decode_packet(kLittle, from_hex("00000100 01000000")));
}

TEST(QualisysCodec, TextCarriesItsZeroInBothOrders) {
  std::vector<std::byte> out;
  encode_text(kLittle, PacketType::kError, "no", out);
  encode_text(kBig, PacketType::kXml, "<a/>", out);
  EXPECT_EQ(out, from_hex("0b000000 00000000 6e6f00 0000000d 00000002 3c612f3e00"));
}

TEST(QualisysCodec, EventsAreNineBytesAndNothingIsEight) {
  std::vector<std::byte> out;
  encode_event(kLittle, Event::kCaptureSaved, out);
  encode_no_more_data(kBig, out);
  EXPECT_EQ(out, from_hex("09000000 06000000 0d 00000008 00000004"));
}

TEST(QualisysCodec, DiscoveryIsReadInEitherByteOrder) {
  // As the SDK broadcasts it: port 4534 in network order.
  const auto little = decode_discover(from_hex("0a000000 07000000 11b6"));
  const auto big = decode_discover(from_hex("0000000a 00000007 11b6"));
  ASSERT_TRUE(little && big);
  EXPECT_EQ(*little, 4534);
  EXPECT_EQ(*big, 4534);
}

TEST(QualisysCodec, DiscoveryThatIsNoneIsRefused) {
  EXPECT_FALSE(decode_discover(from_hex("0a000000 07000000 11")));
  EXPECT_FALSE(decode_discover(from_hex("0a000000 07000000 11b600")));
  EXPECT_FALSE(decode_discover(from_hex("0a000000 01000000 11b6")));
  EXPECT_FALSE(decode_discover(from_hex("0a000000 07000000 0035")));  // the DNS port gets no reply
  EXPECT_FALSE(decode_discover({}));
}

TEST(QualisysCodec, DiscoveryAnswerEndsInTheBasePortInNetworkOrder) {
  std::vector<std::byte> out;
  encode_discover_answer("lab", 22222, out);
  EXPECT_EQ(out, from_hex("0e000000 01000000 6c616200 56ce"));
}

using testing::ElementsAre;

TEST(QualisysCommand, CaseAndSpacesDoNotMatter) {
  const Command command = split_command("  sTreamFrames   AllFrames  6d \r\n");
  EXPECT_TRUE(command.is("StreamFrames"));
  EXPECT_FALSE(command.is("StreamFrame"));
  EXPECT_THAT(words_of(command.rest), ElementsAre("AllFrames", "6d"));
}

TEST(QualisysCommand, EmptyTextIsAnEmptyCommand) {
  EXPECT_EQ(split_command("").name, "");
  EXPECT_EQ(split_command("  \n ").name, "");
}

TEST(QualisysCommand, ReadsEveryRate) {
  EXPECT_EQ(parse_stream_request("allframes 6D")->rate, (Rate{RateKind::kAllFrames, 1}));
  EXPECT_EQ(parse_stream_request("Frequency:60 6D")->rate, (Rate{RateKind::kFrequency, 60}));
  EXPECT_EQ(parse_stream_request("FREQUENCYDIVISOR:4 6D")->rate,
            (Rate{RateKind::kFrequencyDivisor, 4}));
}

TEST(QualisysCommand, RefusesRatesThatCannotBe) {
  for (const char* words :
       {"6D", "Frequency 6D", "Frequency: 6D", "Frequency:0 6D", "Frequency:-1 6D",
        "Frequency:1x 6D", "Frequency:99999999999999999999 6D", "FrequencyDivisor:0 6D",
        "Sometimes:3 6D", ""}) {
    EXPECT_FALSE(parse_stream_request(words)) << words;
  }
}

TEST(QualisysCommand, ReadsBothFormsOfUdp) {
  const auto own = parse_stream_request("AllFrames  UDP:6734 6DEuler 3DNoLabels");
  ASSERT_TRUE(own);
  EXPECT_EQ(own->udp_port, 6734);
  EXPECT_EQ(own->udp_address, "");
  EXPECT_TRUE(own->components.has(Component::k6dEuler));
  EXPECT_TRUE(own->components.has(Component::k3dNoLabels));
  EXPECT_FALSE(own->components.has(Component::k6d));
  const auto named = parse_stream_request("AllFrames udp:10.0.0.7:6734 6D");
  ASSERT_TRUE(named);
  EXPECT_EQ(named->udp_port, 6734);
  EXPECT_EQ(named->udp_address, "10.0.0.7");
  EXPECT_EQ(parse_stream_request("AllFrames 6D")->udp_port, std::nullopt);
}

TEST(QualisysCommand, RefusesUdpPortsThatCannotBe) {
  for (const char* words : {"AllFrames UDP: 6D", "AllFrames UDP:53 6D", "AllFrames UDP:65536 6D",
                            "AllFrames UDP:10.0.0.7: 6D", "AllFrames UDP:-1 6D"}) {
    EXPECT_FALSE(parse_stream_request(words)) << words;
  }
}

TEST(QualisysCommand, ComponentsHaveOptionsAndUnknownWordsAreSkipped) {
  const auto some = parse_components("6d skeleton:global NewFangled");
  ASSERT_TRUE(some);
  EXPECT_TRUE(some->has(Component::k6d));
  EXPECT_TRUE(some->has(Component::kSkeleton));
  EXPECT_FALSE(parse_components("NewFangled"));
  EXPECT_FALSE(parse_components(""));
  EXPECT_EQ(*parse_components("All"), Components::all());
}

TEST(QualisysCommand, KnowsTheVersionsThatThereAre) {
  EXPECT_EQ(parse_version("1.28")->minor, 28);
  EXPECT_EQ(parse_version("1.0")->minor, 0);
  for (const char* word : {"1.29", "2.0", "1.", "1.x", "1.-1", "255.255", "1.28 ", ""}) {
    EXPECT_FALSE(parse_version(word)) << word;
  }
}

TEST(QualisysCommand, KnowsTheGroupsOfParameters) {
  const auto some = parse_parameter_groups("general Skeleton:global");
  ASSERT_TRUE(some);
  EXPECT_TRUE(some->general && some->others);
  EXPECT_FALSE(some->six_d || some->three_d);
  const auto all = parse_parameter_groups("ALL");
  ASSERT_TRUE(all);
  EXPECT_TRUE(all->general && all->six_d && all->three_d);
  EXPECT_FALSE(parse_parameter_groups("Weather"));
  EXPECT_FALSE(parse_parameter_groups(""));
}

}  // namespace
}  // namespace fiducap::qualisys
