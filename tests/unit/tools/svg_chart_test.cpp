#include "tools/calibrate/svg_chart.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(SvgChart, PutsPowersOfTenOnTheBorderOfThePlot) {
  const std::string svg =
      to_svg({{"t", "x", "y", {{"a", "red", false, {{0.01, 1.0}, {100.0, 10.0}}}}}});
  // Plot area: x 70 … 542, y 44 … 366.
  EXPECT_THAT(svg, HasSubstr("<polyline points=\"70.0,366.0 542.0,44.0 \""));
}

TEST(SvgChart, LeavesOutWhatHasNoLogarithm) {
  const std::string svg =
      to_svg({{"t",
               "x",
               "y",
               {{"a", "red", false, {{0.0, 1.0}, {1.0, -2.0}, {1.0, 1.0}, {10.0, 10.0}}}}}});
  EXPECT_THAT(svg, HasSubstr("<polyline points=\"70.0,366.0 542.0,44.0 \""));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(SvgChart, EscapesTexts) {
  EXPECT_THAT(to_svg({{"a<b & \"c\"", "x", "y", {}}}), HasSubstr("a&lt;b &amp; &quot;c&quot;"));
}

}  // namespace
}  // namespace fiducap
