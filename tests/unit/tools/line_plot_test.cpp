#include "tools/plot/line_plot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <limits>

namespace fiducap {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Plot area of a single panel with one name in its legend: x 76 … 740, y 59 … 363.
LinePlot of(std::vector<PlotPoint> points) {
  return {"t", "x", {{"y", {{"a", "red", std::move(points)}}}}};
}

TEST(LinePlot, PutsRoundNumbersOnItsBorder) {
  const std::string svg = to_svg(of({{0, 0}, {10, 5}}));
  EXPECT_THAT(svg, HasSubstr("points=\"76.0,363.0 740.0,59.0\""));
  EXPECT_THAT(svg, HasSubstr(">10<"));
  EXPECT_THAT(svg, HasSubstr(">5<"));
}

TEST(LinePlot, PutsPowersOfTenOnTheBorderOfALogarithmicOne) {
  LinePlot plot = of({{0.01, 1}, {0, 3}, {1, -2}, {100, 10}});
  plot.logarithmic = plot.panels[0].logarithmic = true;
  const std::string svg = to_svg(plot);
  EXPECT_THAT(svg, HasSubstr(">10⁻²<"));
  EXPECT_THAT(svg, HasSubstr("cx=\"76.0\" cy=\"363.0\"")) << "alone before what has no logarithm";
  EXPECT_THAT(svg, HasSubstr("cx=\"740.0\" cy=\"59.0\""));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(LinePlot, BreaksWhereANumberIsMissing) {
  const std::string svg = to_svg(of({{0, 0}, {2, 1}, {3, kNone}, {4, 5}, {10, 5}}));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, HasSubstr("points=\"76.0,363.0 208.8,302.2\""));
  EXPECT_THAT(svg, HasSubstr("points=\"341.6,59.0 740.0,59.0\""));
}

TEST(LinePlot, KeepsTheExtremesOfLongLines) {
  std::vector<PlotPoint> points;
  for (int i = 0; i < 100'000; ++i) points.emplace_back(i, i == 54'321 ? 10 : 0);
  const std::string svg = to_svg(of(points));
  EXPECT_LT(svg.size(), 40'000u);
  EXPECT_THAT(svg, HasSubstr(",59.0 "));
}

TEST(LinePlot, AMetreIsAsLongAcrossAsItIsUp) {
  LinePlot plot{"", "x, m", {{"y, m"}}};
  plot.equal_axes = true;
  plot.panels[0].shapes = {{"tags", "red", {{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, "7"}}}};
  plot.panels[0].lines = {{"", "blue", {{-3, 0}, {5, 1}}}};
  const std::string svg = to_svg(plot);
  const std::size_t at = svg.find("<polygon points=\"") + 17;
  double x[4]{};
  double y[4]{};
  ASSERT_EQ(std::sscanf(svg.c_str() + at, "%lf,%lf %lf,%lf %lf,%lf %lf,%lf", &x[0], &y[0], &x[1],
                        &y[1], &x[2], &y[2], &x[3], &y[3]),
            8);
  constexpr double kDecimal_px = 0.2;  // pixels are written with one
  EXPECT_NEAR(x[1] - x[0], y[1] - y[2], kDecimal_px);
  EXPECT_GT(x[1] - x[0], 50);
  EXPECT_THAT(svg, HasSubstr(">7<"));
}

TEST(LinePlot, LabelsThatWouldLieOnEachOtherAreLeftOut) {
  LinePlot plot{"", "x", {{"y"}}};
  plot.equal_axes = true;
  for (int id : {41, 42}) {
    const double x = 0.001 * id;
    plot.panels[0].shapes.push_back({"", "red", {{{{x, 0}, {x, 1}}, std::to_string(id)}}});
  }
  plot.panels[0].lines = {{"", "blue", {{-3, 0}, {5, 1}}}};
  EXPECT_THAT(to_svg(plot), HasSubstr(">41<"));
  EXPECT_THAT(to_svg(plot), Not(HasSubstr(">42<")));
}

TEST(LinePlot, AnAreaThatShootsUpDoesNotMakeTheLineFlat) {
  LinePlot plot = of({{0, -1}, {100, 1}});
  PlotArea area{"band", "orange", {}};
  for (int i = 0; i <= 100; ++i) {
    const double bound = i == 50 ? 1e6 : 2;
    area.slices.push_back({1. * i, -bound, bound});
  }
  plot.panels[0].areas = {area};
  const std::string svg = to_svg(plot);
  EXPECT_THAT(svg, HasSubstr("points=\"76.0,287.0 740.0,135.0\"")) << "y is -2 … 2";
  EXPECT_THAT(svg, HasSubstr("408.0,59.0")) << "cut off at the border";
}

TEST(LinePlot, ShadedPartsThatShareAPixelAreOneAndNoneVanishes) {
  LinePlot plot = of({{0, 0}, {1000, 5}});
  plot.panels[0].spans = {{"no pose", {{100, 100.01}, {100.02, 100.03}, {700, 800}}}};
  const std::string svg = to_svg(plot);
  std::size_t boxes = 0;
  for (std::size_t at = svg.find("0.28"); at != std::string::npos; at = svg.find("0.28", at + 1))
    ++boxes;
  EXPECT_EQ(boxes, 3u) << "two parts and the legend";
  EXPECT_THAT(svg, HasSubstr("width=\"0.8\""));
}

TEST(LinePlot, ALongTitleIsWrapped) {
  LinePlot plot = of({{0, 0}, {1, 1}});
  plot.title = "Position error against another program: 6.03 mm RMSE, worst 60.81 mm of all poses";
  EXPECT_THAT(to_svg(plot), HasSubstr(" poses</text>"));
  EXPECT_THAT(to_svg(plot), Not(HasSubstr(plot.title)));
}

TEST(LinePlot, EscapesTexts) {
  LinePlot plot = of({{0, 0}, {1, 1}});
  plot.title = "a<b & \"c\"";
  plot.panels[0].lines[0].color = "\"/><script>";
  EXPECT_THAT(to_svg(plot), HasSubstr("a&lt;b &amp; &quot;c&quot;"));
  EXPECT_THAT(to_svg(plot), Not(HasSubstr("<script>")));
}

TEST(LinePlot, DrawsAnEmptyPanel) {
  EXPECT_THAT(to_svg(of({})), HasSubstr("</svg>"));
  EXPECT_THAT(to_svg(of({{kNone, kNone}})), Not(HasSubstr("nan")));
  EXPECT_THAT(to_svg(LinePlot{"nothing", "x"}), HasSubstr("</svg>"));
}

}  // namespace
}  // namespace fiducap
