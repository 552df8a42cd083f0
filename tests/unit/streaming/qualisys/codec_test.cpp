#include "streaming/qualisys/codec.hpp"

#include <gmock/gmock.h>

#include "streaming/qualisys/xml.hpp"
#include "support/hex.hpp"

namespace fiducap::qualisys {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr auto kLittle = std::endian::little;
constexpr auto kBig = std::endian::big;

TEST(QualisysCodec, ReadsPacketsOfTheSdkAndWaitsForTruncatedOnes) {
  // `Version 1.28` on the little-endian port, as the vendor's C++ SDK 1.28 sends it.
  const auto bytes = from_hex("15000000 01000000 56657273696f6e20312e323800");
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    const auto packet = decode_packet(kLittle, std::span(bytes).first(n));
    ASSERT_TRUE(packet) << n;
    EXPECT_FALSE(*packet) << n;
  }
  const auto packet = decode_packet(kLittle, bytes);
  ASSERT_TRUE(packet && *packet);
  EXPECT_EQ((*packet)->type, PacketType::kCommand);
  EXPECT_EQ((*packet)->size, bytes.size());
  EXPECT_EQ(decode_text((*packet)->payload), "Version 1.28");
}

TEST(QualisysCodec, RejectsInvalidSizesAndReadsTextWithoutTerminator) {
  EXPECT_FALSE(decode_packet(kLittle, from_hex("07000000 01000000")));
  EXPECT_FALSE(decode_packet(kLittle, from_hex("ffffffff 01000000")));
  EXPECT_FALSE(decode_packet(kLittle, from_hex("01000100 01000000")));  // one more than the limit
  EXPECT_TRUE(decode_packet(kLittle, from_hex("00000100 01000000")));
  const auto bytes = from_hex("0000000b 00000001 4e6577");
  const auto packet = decode_packet(kBig, bytes);
  ASSERT_TRUE(packet && *packet);
  EXPECT_EQ(decode_text((*packet)->payload), "New");
}

TEST(QualisysCodec, EncodesTextEventsAndNoDataInBothByteOrders) {
  std::vector<std::byte> out;
  encode_text(kLittle, PacketType::kError, "no", out);
  encode_text(kBig, PacketType::kXml, "<a/>", out);
  encode_event(kLittle, Event::kCaptureSaved, out);
  encode_no_more_data(kBig, out);
  EXPECT_EQ(out, from_hex("0b000000 00000000 6e6f00 0000000d 00000002 3c612f3e00"
                          "09000000 06000000 0d 00000008 00000004"));
}

TEST(QualisysCodec, ReadsDiscoveryInBothByteOrders) {
  // As the SDK broadcasts it: port 4534 in network order.
  EXPECT_EQ(decode_discover(from_hex("0a000000 07000000 11b6")).value_or(0), 4534);
  EXPECT_EQ(decode_discover(from_hex("0000000a 00000007 11b6")).value_or(0), 4534);
  for (const char* other : {"0a000000 07000000 11", "0a000000 07000000 11b600",
                            "0a000000 01000000 11b6", "0a000000 07000000 0035" /* DNS */, ""}) {
    EXPECT_FALSE(decode_discover(from_hex(other))) << other;
  }
  std::vector<std::byte> out;
  encode_discover_answer("lab", 22222, out);
  EXPECT_EQ(out, from_hex("0e000000 01000000 6c616200 56ce")) << "base port in network order";
}

TEST(QualisysCommand, IgnoresCaseAndSpaces) {
  const Command command = split_command("  sTreamFrames   AllFrames  6d \r\n");
  EXPECT_TRUE(command.is("StreamFrames"));
  EXPECT_FALSE(command.is("StreamFrame"));
  EXPECT_THAT(words_of(command.rest), testing::ElementsAre("AllFrames", "6d"));
  EXPECT_EQ(split_command("").name, "");
  EXPECT_EQ(split_command("  \n ").name, "");
}

TEST(QualisysCommand, ReadsRatesAndRejectsInvalidOnes) {
  EXPECT_EQ(parse_stream_request("allframes 6D")->rate, (Rate{RateKind::kAllFrames, 1}));
  EXPECT_EQ(parse_stream_request("Frequency:60 6D")->rate, (Rate{RateKind::kFrequency, 60}));
  EXPECT_EQ(parse_stream_request("FREQUENCYDIVISOR:4 6D")->rate,
            (Rate{RateKind::kFrequencyDivisor, 4}));
  for (const char* words :
       {"6D", "Frequency 6D", "Frequency: 6D", "Frequency:0 6D", "Frequency:-1 6D",
        "Frequency:1x 6D", "Frequency:99999999999999999999 6D", "FrequencyDivisor:0 6D",
        "Sometimes:3 6D", "", "AllFrames UDP: 6D", "AllFrames UDP:53 6D", "AllFrames UDP:65536 6D",
        "AllFrames UDP:10.0.0.7: 6D", "AllFrames UDP:-1 6D"}) {
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

TEST(QualisysCommand, ReadsComponentsAndSkipsUnknownOnes) {
  const auto some = parse_components("6d skeleton:global NewFangled");
  ASSERT_TRUE(some);
  EXPECT_TRUE(some->has(Component::k6d));
  EXPECT_TRUE(some->has(Component::kSkeleton));
  EXPECT_FALSE(parse_components("NewFangled"));
  EXPECT_FALSE(parse_components(""));
  EXPECT_EQ(*parse_components("All"), Components::all());
}

TEST(QualisysCommand, ReadsSupportedVersionsOnly) {
  EXPECT_EQ(parse_version("1.28")->minor, 28);
  EXPECT_EQ(parse_version("1.0")->minor, 0);
  for (const char* word : {"1.29", "2.0", "1.", "1.x", "1.-1", "255.255", "1.28 ", ""}) {
    EXPECT_FALSE(parse_version(word)) << word;
  }
}

TEST(QualisysCommand, ReadsGroupsOfParameters) {
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

const std::array<BodyTable::Entry, 2> kBodies{{{1, "arm <1>", true}, {2, "drone", false}}};

std::string xml(std::string_view groups, int minor, UpAxis up = UpAxis::kZ) {
  return parameters_xml(*parse_parameter_groups(groups), {minor}, kBodies, up, 200);
}

TEST(QualisysParameters, ListBodiesInTheFormatOfTheVersion) {
  EXPECT_THAT(xml("6D", 25), AllOf(testing::StartsWith("<QTM_Parameters_Ver_1.25><The_6D>"),
                                   testing::EndsWith("</The_6D></QTM_Parameters_Ver_1.25>")));
  EXPECT_THAT(xml("6D", 28), AllOf(HasSubstr("<Name>arm &lt;1&gt;</Name><Enabled>True</Enabled>"),
                                   HasSubstr("<Name>drone</Name><Enabled>False</Enabled>"),
                                   Not(HasSubstr("<Bodies>"))));
  EXPECT_THAT(xml("6D", 20),
              HasSubstr("<The_6D><Bodies>2</Bodies><Body><Name>arm &lt;1&gt;</Name><RGBColor>"));
  EXPECT_THAT(
      xml("6D", 19),
      AllOf(HasSubstr("</Euler></The_6D><Bodies>2</Bodies><Body><Name>arm &lt;1&gt;</Name>"),
            testing::EndsWith("</Euler></QTM_Parameters_Ver_1.19>")))
      << "where a newer SDK that asks for an old version looks";
  EXPECT_THAT(xml("6D", 16), HasSubstr("<Euler><First>Roll</First>"));
  EXPECT_THAT(xml("6D", 15), Not(HasSubstr("<Euler>")));
}

TEST(QualisysParameters, ContainSupportedGroupsAndTheUpAxis) {
  EXPECT_EQ(xml("Analog Force", 28), "<QTM_Parameters_Ver_1.28></QTM_Parameters_Ver_1.28>");
  EXPECT_THAT(xml("All", 28), AllOf(HasSubstr("<General><Frequency>200</Frequency>"),
                                    HasSubstr("<The_3D>"), HasSubstr("<The_6D>")));
  EXPECT_THAT(xml("3D", 28), HasSubstr("<AxisUpwards>+Z</AxisUpwards>"));
  EXPECT_THAT(xml("3D", 28, UpAxis::kY), HasSubstr("<AxisUpwards>+Y</AxisUpwards>"));
  EXPECT_THAT(xml("3D", 28, UpAxis::kDown), HasSubstr("<AxisUpwards>-Z</AxisUpwards>"));
}

TEST(QualisysParameters, EscapeSpecialCharacters) {
  EXPECT_EQ(escape_xml("a&b<c>d\"e'f\n"), "a&amp;b&lt;c&gt;d&quot;e&apos;f_");
  EXPECT_EQ(escape_xml("grün"), "grün");
}

TEST(QualisysSettings, ReadsNameAndSwitchOfTheSdkAndIgnoresOtherSettings) {
  const auto found = parse_body_switches(
      "<?xml version=\"1.0\"?><QTM_Settings>\n <The_6D>\n  <Body>\n   <Name>arm &lt;1&gt;</Name>"
      "<Enabled>false</Enabled><Color R=\"1\" G=\"2\" B=\"3\"/><Points><Point X=\"1\"/></Points>"
      "<Mesh><Name>other</Name></Mesh></Body>\n  "
      "<Body><Enabled>True</Enabled><Name>drone</Name></Body>"
      "<Body><Name>quiet</Name></Body></The_6D></QTM_Settings>");
  ASSERT_TRUE(found);
  ASSERT_EQ(found->size(), 2u);
  EXPECT_EQ((*found)[0].name, "arm <1>");
  EXPECT_FALSE((*found)[0].enabled);
  EXPECT_EQ((*found)[1].name, "drone");
  EXPECT_TRUE((*found)[1].enabled);
  for (const char* text :
       {"<QTM_Settings><General><Frequency>9</Frequency></General></QTM_Settings>", ""}) {
    ASSERT_TRUE(parse_body_switches(text)) << text;
    EXPECT_TRUE(parse_body_switches(text)->empty()) << text;
  }
}

TEST(QualisysSettings, RejectsBrokenDeepAndLongText) {
  for (const char* text : {"<a", "<a>", "</a>", "<a></b>", "<>", "<a><b></a></b>", "< >"}) {
    EXPECT_FALSE(parse_body_switches(text)) << text;
  }
  std::string deep;
  for (int i = 0; i < 17; ++i) deep = "<a>" + deep + "</a>";
  EXPECT_FALSE(parse_body_switches(deep));
  std::string many = "<The_6D>";
  for (int i = 0; i < 1001; ++i) many += "<Body><Name>x</Name><Enabled>true</Enabled></Body>";
  EXPECT_FALSE(parse_body_switches(many + "</The_6D>"));
}

}  // namespace
}  // namespace fiducap::qualisys
