#include "streaming/qualisys/settings.hpp"

#include <gtest/gtest.h>

namespace fiducap::qualisys {
namespace {

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
