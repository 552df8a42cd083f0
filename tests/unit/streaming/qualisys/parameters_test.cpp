#include "streaming/qualisys/parameters.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

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

}  // namespace
}  // namespace fiducap::qualisys
