#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "streaming/qualisys/xml.hpp"

namespace fiducap::qualisys {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

const std::array<BodyTable::Entry, 2> kBodies{{{1, "arm <1>", true}, {2, "drone", false}}};

std::string xml(std::string_view groups, int minor, UpAxis up = UpAxis::kZ) {
  return parameters_xml(*parse_parameter_groups(groups), {minor}, kBodies, up, 200);
}

TEST(QualisysParameters, TheRootNamesTheVersion) {
  EXPECT_THAT(xml("6D", 25), StartsWith("<QTM_Parameters_Ver_1.25><The_6D>"));
  EXPECT_THAT(xml("6D", 25), EndsWith("</The_6D></QTM_Parameters_Ver_1.25>"));
}

TEST(QualisysParameters, BodiesCarryNameAndSwitchSafely) {
  const std::string text = xml("6D", 28);
  EXPECT_THAT(text, HasSubstr("<Name>arm &lt;1&gt;</Name><Enabled>True</Enabled>"));
  EXPECT_THAT(text, HasSubstr("<Name>drone</Name><Enabled>False</Enabled>"));
  EXPECT_THAT(text, Not(HasSubstr("<Bodies>")));
}

TEST(QualisysParameters, Until20BodiesAreCountedAndDescribedTheOldWay) {
  EXPECT_THAT(xml("6D", 20),
              HasSubstr("<The_6D><Bodies>2</Bodies><Body><Name>arm &lt;1&gt;</Name><RGBColor>"));
  EXPECT_THAT(xml("6D", 16), HasSubstr("<Euler><First>Roll</First>"));
  EXPECT_THAT(xml("6D", 15), Not(HasSubstr("<Euler>")));
}

TEST(QualisysParameters, GroupsThatWeDoNotHaveAreLeftOut) {
  EXPECT_EQ(xml("Analog Force", 28), "<QTM_Parameters_Ver_1.28></QTM_Parameters_Ver_1.28>");
  const std::string all = xml("All", 28);
  EXPECT_THAT(all, HasSubstr("<General><Frequency>200</Frequency>"));
  EXPECT_THAT(all, HasSubstr("<The_3D>"));
  EXPECT_THAT(all, HasSubstr("<The_6D>"));
}

TEST(QualisysParameters, SaysWhichAxisIsUp) {
  EXPECT_THAT(xml("3D", 28), HasSubstr("<AxisUpwards>+Z</AxisUpwards>"));
  EXPECT_THAT(xml("3D", 28, UpAxis::kY), HasSubstr("<AxisUpwards>+Y</AxisUpwards>"));
  EXPECT_THAT(xml("3D", 28, UpAxis::kDown), HasSubstr("<AxisUpwards>-Z</AxisUpwards>"));
}

TEST(QualisysParameters, EscapesWhatWouldBreakTheText) {
  EXPECT_EQ(escape_xml("a&b<c>d\"e'f\n"), "a&amp;b&lt;c&gt;d&quot;e&apos;f_");
  EXPECT_EQ(escape_xml("grün"), "grün");
}

TEST(QualisysSettings, TakesNameAndSwitchOutOfWhatTheSdkSends) {
  const auto found = parse_body_switches(
      "<?xml version=\"1.0\"?><QTM_Settings>\n <The_6D>\n  <Body>\n   <Name>arm &lt;1&gt;</Name>"
      "<Enabled>false</Enabled><Color R=\"1\" G=\"2\" B=\"3\"/><Points><Point X=\"1\"/></Points>"
      "<Mesh><Name>other</Name></Mesh></Body>\n  "
      "<Body><Enabled>True</Enabled><Name>drone</Name></Body>"
      "<Body><Name>quiet</Name></Body></The_6D></QTM_Settings>");
  ASSERT_TRUE(found) << found.error().text();
  ASSERT_EQ(found->size(), 2u);
  EXPECT_EQ((*found)[0].name, "arm <1>");
  EXPECT_FALSE((*found)[0].enabled);
  EXPECT_EQ((*found)[1].name, "drone");
  EXPECT_TRUE((*found)[1].enabled);
}

TEST(QualisysSettings, OtherSettingsAreNoneOfOurs) {
  const auto found = parse_body_switches(
      "<QTM_Settings><General><Frequency>9</Frequency></General></QTM_Settings>");
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->empty());
  EXPECT_TRUE(parse_body_switches("")->empty());
}

TEST(QualisysSettings, BrokenTextIsRefused) {
  for (const char* text : {"<a", "<a>", "</a>", "<a></b>", "<>", "<a><b></a></b>", "< >"}) {
    EXPECT_FALSE(parse_body_switches(text)) << text;
  }
  std::string deep;
  for (int i = 0; i < 17; ++i) deep += "<a>";
  for (int i = 0; i < 17; ++i) deep += "</a>";
  EXPECT_FALSE(parse_body_switches(deep));
  std::string many = "<The_6D>";
  for (int i = 0; i < 1001; ++i) many += "<Body><Name>x</Name><Enabled>true</Enabled></Body>";
  EXPECT_FALSE(parse_body_switches(many + "</The_6D>"));
}

}  // namespace
}  // namespace fiducap::qualisys
