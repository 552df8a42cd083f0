#include "tools/plot/plot_page.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include <nlohmann/json.hpp>

#include "support/well_formed.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
const Expected<std::string> kScript{"draw()"};
const Expected<std::string> kNoScript = fail(ErrorCode::kNotFound, "no such file", "plots.js");

PlotPage page() {
  PlotPage page;
  page.title = "<hall> & \"more\"";
  page.remarks = {"a < b"};
  page.plots = {{"one", "x", {{"y", {{"a", "red", {{0, 0}, {1, 1}}}}}}}, {"two", "x", {{"y"}}}};
  page.plots[0].subtitle = "so & so";
  page.tables = {{"Figures", {{"name & <name>", "1 \x01 mm"}}}};
  return page;
}

LinePlot of(std::vector<PlotPoint> points) {
  return {"t", "x", {{"y", {{"a", "red", std::move(points)}}}}};
}

/// The data of a page with this plot.
nlohmann::json json_of(const LinePlot& plot) {
  PlotPage page;
  page.plots = {plot};
  const std::string html = to_html(page, kScript);
  const std::string start = "id=\"plots\">";
  const std::size_t begin = html.find(start) + start.size();
  return nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin))[0];
}

nlohmann::json points_of(const LinePlot& plot) {
  return json_of(plot)["panels"][0]["lines"][0]["points"];
}

TEST(PlotPage, WithoutItsScriptIsWellFormedAndSaysWhatIsMissing) {
  EXPECT_EQ(test::xml_fault(to_html(page(), kNoScript)), "");
  EXPECT_EQ(test::xml_fault(to_html({}, kNoScript)), "");
  EXPECT_THAT(to_html(page(), kNoScript), HasSubstr("plots.js"));
}

TEST(PlotPage, TheTestOfWellFormedTextCanFail) {
  for (const char* bad : {"<a>", "<a></b>", "<a b=c/>", "<a b=\"<\"/>", "<a>&</a>", "<a>&foo;</a>",
                          "<a b=\"1\" b=\"2\"/>", "<a/><b/>", "</a>", "<a>\x01</a>", ""})
    EXPECT_NE(test::xml_fault(bad), "") << bad;
  EXPECT_EQ(test::xml_fault("<!DOCTYPE html>\n<a b=\"1\" c=\"&lt;\">x &amp; y<d/></a>\n"), "");
}

TEST(PlotPage, NeedsNothingFromElsewhere) {
  const std::string html = to_html(page(), kScript);
  EXPECT_THAT(html, HasSubstr("<script>draw()</script>"));
  EXPECT_THAT(html, Not(HasSubstr("src=")));
  EXPECT_THAT(html, Not(HasSubstr("href")));
  EXPECT_THAT(html, Not(HasSubstr("url(")));
  EXPECT_THAT(html, HasSubstr("prefers-color-scheme: dark"));
  EXPECT_THAT(html, HasSubstr("width=device-width"));
}

TEST(PlotPage, NamesCannotEndTheScript) {
  LinePlot plot = of({{0, 0}, {1, 1}});
  plot.panels[0].lines[0].name = "</script><script>alert(1)";
  PlotPage page;
  page.plots = {plot};
  EXPECT_THAT(to_html(page, kScript), Not(HasSubstr("alert(1)</script>")));
  EXPECT_THAT(to_html(page, kScript), Not(HasSubstr("</script><script>alert")));
  EXPECT_EQ(json_of(plot)["panels"][0]["lines"][0]["name"], plot.panels[0].lines[0].name);
}

TEST(PlotPage, TheAxesHoldAllNumbers) {
  const auto json = json_of(of({{0, -1}, {10, 5}}));
  EXPECT_EQ(json["x"], (std::vector<double>{0, 10}));
  EXPECT_LT(json["panels"][0]["y"][0], -1);
  EXPECT_GT(json["panels"][0]["y"][1], 5);
  LinePlot plot = of({{0, 1}, {10, 5}});
  plot.panels[0].from_zero = true;
  EXPECT_EQ(json_of(plot)["panels"][0]["y"][0], 0);
}

TEST(PlotPage, ALogarithmicAxisHasWholeDecades) {
  LinePlot plot = of({{0.02, 1}, {0, 3}, {1, -2}, {50, 10}});
  plot.logarithmic = plot.panels[0].logarithmic = true;
  const auto json = json_of(plot);
  EXPECT_FLOAT_EQ(json["x"][0].get<float>(), 0.01F);
  EXPECT_EQ(json["x"][1], 100);
  const auto points = points_of(plot);
  EXPECT_TRUE(points[2].is_null()) << "zero has no logarithm";
  EXPECT_TRUE(points[5].is_null());
}

TEST(PlotPage, BreaksWhereANumberIsMissing) {
  const auto points = points_of(of({{0, 0}, {2, 1}, {3, kNone}, {4, 5}}));
  ASSERT_EQ(points.size(), 8u);
  EXPECT_TRUE(points[5].is_null());
}

TEST(PlotPage, KeepsTheExtremesOfLongCurves) {
  std::vector<PlotPoint> points;
  for (int i = 0; i < 100'000; ++i) points.emplace_back(i, i == 54'321 ? 10 : 0);
  const auto kept = points_of(of(points));
  EXPECT_LT(kept.size(), 20'000u);
  EXPECT_THAT(kept.get<std::vector<double>>(), testing::Contains(10));
}

TEST(PlotPage, ARobotAtRestIsAFewPoints) {
  LinePlot plot = of(std::vector<PlotPoint>(100'000, {4, 5}));
  plot.equal_axes = true;
  EXPECT_LE(points_of(plot).size(), 8u);
}

TEST(PlotPage, AnAreaThatShootsUpDoesNotMakeTheCurveFlat) {
  LinePlot plot = of({{0, -1}, {100, 1}});
  PlotArea area{"band", "orange", {}};
  for (int i = 0; i <= 100; ++i) {
    const double bound = i == 50 ? 1e6 : 2;
    area.slices.push_back({1. * i, -bound, bound});
  }
  plot.panels[0].areas = {area};
  EXPECT_LT(json_of(plot)["panels"][0]["y"][1], 2.5);
}

TEST(PlotPage, AnAreaStaysAsHighAndAsLowAsItIs) {
  LinePlot plot = of({});
  PlotArea area{"band", "orange", {}};
  for (int i = 0; i < 100'000; ++i)
    area.slices.push_back({1. * i, i == 54'321 ? 1.0 : 40.0, i == 12'345 ? 90.0 : 60.0});
  plot.panels[0].areas = {area};
  const auto slices = json_of(plot)["panels"][0]["areas"][0]["slices"].get<std::vector<double>>();
  EXPECT_LE(slices.size(), 3 * 2001u);
  EXPECT_THAT(slices, testing::Contains(1.0));
  EXPECT_THAT(slices, testing::Contains(90.0));
}

TEST(PlotPage, HasRangesWithoutNumbersAndForASingleOne) {
  for (const auto& points :
       {std::vector<PlotPoint>{}, {{kNone, kNone}}, {{7, 7}}, {{1e12, 1e12}, {1e12, 1e12}}})
    for (const bool logarithmic : {false, true}) {
      LinePlot plot = of(points);
      plot.logarithmic = plot.panels[0].logarithmic = logarithmic;
      const auto json = json_of(plot);
      EXPECT_LT(json["x"][0], json["x"][1]);
      EXPECT_LT(json["panels"][0]["y"][0], json["panels"][0]["y"][1]);
    }
  EXPECT_EQ(json_of({"nothing", "x"})["panels"].size(), 0u);
}

}  // namespace
}  // namespace fiducap
