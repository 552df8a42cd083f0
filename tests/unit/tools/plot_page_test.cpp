#include "tools/plot/plot_page.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/well_formed.hpp"
#include "tools/plot/line_plot.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

PlotPage page() {
  PlotPage page;
  page.title = "<hall> & \"more\"";
  page.remarks = {"a < b"};
  page.plots = {{"one", "x", {{"y", {{"a", "red", {{0, 0}, {1, 1}}}}}}}, {"two", "x", {{"y"}}}};
  page.plots[0].subtitle = "so & so";
  page.tables = {{"Figures", {{"name & <name>", "1 \x01 mm"}}}};
  return page;
}

TEST(PlotPage, IsWellFormed) {
  EXPECT_EQ(test::xml_fault(to_html(page())), "");
  EXPECT_EQ(test::xml_fault(to_svg(page())), "");
  EXPECT_EQ(test::xml_fault(to_html({})), "");
  EXPECT_EQ(test::xml_fault(to_svg(PlotPage{})), "");
}

TEST(PlotPage, TheTestOfWellFormedTextCanFail) {
  for (const char* bad : {"<a>", "<a></b>", "<a b=c/>", "<a b=\"<\"/>", "<a>&</a>", "<a>&foo;</a>",
                          "<a b=\"1\" b=\"2\"/>", "<a/><b/>", "</a>", "<a>\x01</a>", ""})
    EXPECT_NE(test::xml_fault(bad), "") << bad;
  EXPECT_EQ(test::xml_fault("<!DOCTYPE html>\n<a b=\"1\" c=\"&lt;\">x &amp; y<d/></a>\n"), "");
}

TEST(PlotPage, NeedsNothingFromElsewhereAndRunsNothing) {
  const std::string html = to_html(page());
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("src=")));
  EXPECT_THAT(html, Not(HasSubstr("href")));
  EXPECT_THAT(html, Not(HasSubstr("url(")));
  EXPECT_THAT(html, HasSubstr("prefers-color-scheme: dark"));
  EXPECT_THAT(html, HasSubstr("width=device-width"));
}

TEST(PlotPage, ThePicturesOfAnSvgLieBelowEachOther) {
  const std::string svg = to_svg(page());
  EXPECT_THAT(svg, HasSubstr("translate(0 0.0)"));
  EXPECT_THAT(svg, Not(HasSubstr("translate(0 0.0)\">\n<g transform=\"translate(0 0.0)")));
  EXPECT_THAT(svg, HasSubstr(">two<"));
}

}  // namespace
}  // namespace fiducap
