#include "paper/line_plot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace fiducap::bench {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// Plot area of a single panel: x 78 … 730, y 46 … 350.
LinePlot of(std::vector<PlotPoint> points) {
  return {"t", "x", {{"y", {{"a", "red", std::move(points)}}}}};
}

TEST(LinePlot, PutsRoundNumbersOnItsBorder) {
  const std::string svg = to_svg(of({{0, 0}, {10, 5}}));
  EXPECT_THAT(svg, HasSubstr("points=\"78.0,350.0 730.0,46.0 \""));
  EXPECT_THAT(svg, HasSubstr(">10<"));
  EXPECT_THAT(svg, HasSubstr(">5<"));
}

TEST(LinePlot, BreaksWhereANumberIsMissing) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const std::string svg = to_svg(of({{0, 0}, {2, 1}, {3, kNone}, {4, 5}, {10, 5}}));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, HasSubstr("points=\"78.0,350.0 208.4,289.2 \""));
  EXPECT_THAT(svg, HasSubstr("points=\"338.8,46.0 730.0,46.0 \""));
}

TEST(LinePlot, KeepsTheExtremesOfLongLines) {
  std::vector<PlotPoint> points;
  for (int i = 0; i < 100'000; ++i) points.emplace_back(i, i == 54'321 ? 10 : 0);
  const std::string svg = to_svg(of(points));
  EXPECT_LT(svg.size(), 40'000u);
  EXPECT_THAT(svg, HasSubstr(",46.0 "));
}

TEST(LinePlot, EscapesTexts) {
  LinePlot plot = of({{0, 0}, {1, 1}});
  plot.title = "a<b & c";
  EXPECT_THAT(to_svg(plot), HasSubstr("a&lt;b &amp; c"));
}

TEST(LinePlot, DrawsAnEmptyPanel) { EXPECT_THAT(to_svg(of({})), HasSubstr("</svg>")); }

}  // namespace
}  // namespace fiducap::bench
