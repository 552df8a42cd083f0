#include "tools/plot/plot_page.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <limits>

#include <nlohmann/json.hpp>

#include "support/well_formed.hpp"
#include "tools/replay/run_plots.hpp"

namespace fiducap {
namespace {

using std::chrono::milliseconds;
using testing::AllOf;
using testing::Contains;
using testing::DoubleEq;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;

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

std::string html_of(const LinePlot& plot) {
  PlotPage page;
  page.plots = {plot};
  return to_html(page, kScript);
}
/// The data of a page with this plot.
nlohmann::json json_of(const LinePlot& plot) {
  const std::string html = html_of(plot);
  const std::string start = "id=\"plots\">";
  const std::size_t begin = html.find(start) + start.size();
  return nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin))[0];
}
nlohmann::json points_of(const LinePlot& plot) {
  return json_of(plot)["panels"][0]["lines"][0]["points"];
}

TEST(PlotPage, WithoutItsScriptIsWellFormed) {
  EXPECT_EQ(test::xml_fault(to_html(page(), kNoScript)), "");
  EXPECT_EQ(test::xml_fault(to_html({}, kNoScript)), "");
  EXPECT_THAT(to_html(page(), kNoScript), HasSubstr("plots.js"));
}

TEST(PlotPage, NeedsNoOtherFile) {
  const std::string html = to_html(page(), kScript);
  for (const char* part :
       {"<script>draw()</script>", "prefers-color-scheme: dark", "width=device-width"})
    EXPECT_THAT(html, HasSubstr(part));
  for (const char* reference : {"src=", "href", "url("})
    EXPECT_THAT(html, Not(HasSubstr(reference)));
}

TEST(PlotPage, NamesCannotEndTheScript) {
  LinePlot plot = of({{0, 0}, {1, 1}});
  plot.panels[0].lines[0].name = "</script><script>alert(1)";
  EXPECT_THAT(html_of(plot),
              AllOf(Not(HasSubstr("alert(1)</script>")), Not(HasSubstr("</script><script>alert"))));
  EXPECT_EQ(json_of(plot)["panels"][0]["lines"][0]["name"], plot.panels[0].lines[0].name);
}

TEST(PlotPage, AxesContainAllNumbers) {
  const auto json = json_of(of({{0, -1}, {10, 5}}));
  EXPECT_EQ(json["x"], (std::vector<double>{0, 10}));
  EXPECT_LT(json["panels"][0]["y"][0], -1);
  EXPECT_GT(json["panels"][0]["y"][1], 5);
  LinePlot plot = of({{0, 1}, {10, 5}});
  plot.panels[0].from_zero = true;
  EXPECT_EQ(json_of(plot)["panels"][0]["y"][0], 0);
}

TEST(PlotPage, LogarithmicAxisHasWholeDecades) {
  LinePlot plot = of({{0.02, 1}, {0, 3}, {1, -2}, {50, 10}});
  plot.logarithmic = plot.panels[0].logarithmic = true;
  const auto json = json_of(plot);
  EXPECT_FLOAT_EQ(json["x"][0].get<float>(), 0.01F);
  EXPECT_EQ(json["x"][1], 100);
  EXPECT_TRUE(points_of(plot)[2].is_null()) << "zero has no logarithm";
  EXPECT_TRUE(points_of(plot)[5].is_null());
}

TEST(PlotPage, LongLineKeepsItsExtremes) {
  std::vector<PlotPoint> points;
  for (int i = 0; i < 100'000; ++i) points.emplace_back(i, i == 54'321 ? 10 : 0);
  const auto kept = points_of(of(points));
  EXPECT_LT(kept.size(), 20'000u);
  EXPECT_THAT(kept.get<std::vector<double>>(), Contains(10));
}

TEST(PlotPage, RepeatedPointIsAFewPoints) {
  LinePlot plot = of(std::vector<PlotPoint>(100'000, {4, 5}));
  plot.equal_axes = true;
  EXPECT_LE(points_of(plot).size(), 8u);
}

TEST(PlotPage, AxesIgnoreAPeakOfAnArea) {
  LinePlot plot = of({{0, -1}, {100, 1}});
  PlotArea area{"band", "orange", {}};
  for (int i = 0; i <= 100; ++i) {
    const double bound = i == 50 ? 1e6 : 2;
    area.slices.push_back({1. * i, -bound, bound});
  }
  plot.panels[0].areas = {area};
  EXPECT_LT(json_of(plot)["panels"][0]["y"][1], 2.5);
}

TEST(PlotPage, LongAreaKeepsItsExtremes) {
  LinePlot plot = of({});
  PlotArea area{"band", "orange", {}};
  for (int i = 0; i < 100'000; ++i)
    area.slices.push_back({1. * i, i == 54'321 ? 1.0 : 40.0, i == 12'345 ? 90.0 : 60.0});
  plot.panels[0].areas = {area};
  const auto slices = json_of(plot)["panels"][0]["areas"][0]["slices"].get<std::vector<double>>();
  EXPECT_LE(slices.size(), 3 * 2001u);
  EXPECT_THAT(slices, AllOf(Contains(1.0), Contains(90.0)));
}

TEST(PlotPage, AxesHaveLengthForAnyNumberOfPoints) {
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

Instant at_image(int k) { return instant_from_ns(1'000'000'000'000) + k * milliseconds(50); }

OfflineResult result() {
  OfflineResult r;
  for (int k = 0; k < 100; ++k) {
    r.images.push_back({at_image(k), k % 5});
    if (k >= 40 && k < 60) continue;
    r.trajectory.push_back({at_image(k), {{1, 0, 0, 0}, {0.02 * k, 0.1, 1}}});
    r.covariances.push_back({at_image(k), Matrix6d::Identity() * 1e-6});
  }
  r.known = {{3, 0.2, {}, Matrix6d::Zero()}};
  TagBelief belief;
  belief.tag = {17, 0.16, {exp_so3({0, 1.5707963, 0}), {1, 0.7, 1}}, Matrix6d::Identity() * 1e-6};
  r.tags = {belief};
  r.events = {{BodyEvent::Kind::kReset, at_image(40), -1, {}, {}},
              {BodyEvent::Kind::kMismatch, at_image(70), -1, {}, "tags seem <larger> & wider"}};
  return r;
}

TEST(PosePlots, GapsAreThreeOrMoreImagesWithoutAPose) {
  const auto gaps = [](const std::vector<int>& images) {
    std::vector<StampedPose> poses;
    for (const int k : images) poses.push_back({at_image(k), {{1, 0, 0, 0}, {0.01 * k, 1, 0}}});
    return missing_poses(poses, at_image(0), at_image(20), at_image(0)).from_to;
  };
  EXPECT_THAT(gaps({0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 20}),
              testing::IsEmpty());
  EXPECT_THAT(gaps({0, 1, 2, 3, 4, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20}),
              ElementsAre(Pair(DoubleEq(0.2), DoubleEq(0.5))));
  EXPECT_THAT(gaps({10, 11, 12}), ElementsAre(Pair(0, 0.5), Pair(DoubleEq(0.6), 1)));
  EXPECT_THAT(gaps({}), ElementsAre(Pair(0, 1)));
}

TEST(PosePlots, TagOnAWallIsALineFromAbove) {
  const std::vector<TagPlace> tags{{7, 0.2, {exp_so3({1.5707963267948966, 0, 0}), {1, 2, 3}}}};
  const PlotShapes shapes = tags_from_above("tags", "red", tags, true);
  ASSERT_EQ(shapes.shapes.size(), 1u);
  constexpr double kRounding_m = 1e-12;
  for (const PlotPoint& p : shapes.shapes[0].outline) EXPECT_NEAR(p.second, 2, kRounding_m);
}

class RunPlots : public ::testing::Test {
 protected:
  [[nodiscard]] std::string page() const {
    const std::vector<RunBody> bodies{{"rover<1>", "", &setup_, &result_},
                                      {"arm", "", &setup_, &result_}};
    return to_html(run_plots(bodies, session_), kScript);
  }
  OfflineSetup setup_;
  OfflineResult result_{result()};
  OfflineSession session_;
};

TEST_F(RunPlots, ShowAllBodiesWithTheirEvents) {
  for (const char* there :
       {"Map from above: 2 tags", "path of rover\\u003c1>", "arm over time", "no pose", "restarted",
        "tags in the image", "\"17\"", "tags seem &lt;larger&gt; &amp; wider", "position σ, mm"})
    EXPECT_THAT(page(), HasSubstr(there));
  result_ = {};
  EXPECT_THAT(page(), HasSubstr("Map from above")) << "there is no image";
}

TEST_F(RunPlots, OmitNumbersThatAreNotFinite) {
  result_.trajectory[3].X_WB.p.x() = std::numeric_limits<double>::quiet_NaN();
  result_.covariances[5].covariance(0, 0) = -1;
  EXPECT_THAT(page(), AllOf(HasSubstr("null"), Not(HasSubstr("nan"))));
}

class EvaluationPlots : public ::testing::Test {
 protected:
  /// Errors of a millimetre along x of W; the axes of the tag are rotated by 90° about z.
  EvaluationPlots() {
    evaluation_.against = Evaluation::Against::kTruth;
    evaluation_.reference_tag = 3;
    evaluation_.pose = PoseErrors{90, 0.001, 0.002, 0.01, 0.02};
    EvaluationTraces& traces = evaluation_.traces;
    traces.first_image = at_image(0);
    traces.last_image = at_image(199);
    traces.settled_at = at_image(100);
    traces.X_WA = {exp_so3({0, 0, 1.5707963267948966}), {0, 0, 0}};
    for (int k = 100; k < 200; ++k)
      traces.differences.push_back({at_image(k), {0, -1e-3, 0}, Eigen::Vector3d::Zero()});
    traces.reprojection_px = {0.1, 0.2, 0.3, 40};
    for (int k = 0; k < 200; ++k) run_.trajectory.push_back({at_image(k), {}});
    run_.map = {{3, 0.2, {}}};
  }

  static std::vector<StampedCovariance> certain_along(int axis) {
    std::vector<StampedCovariance> covariances;
    for (int k = 0; k < 200; ++k) {
      Matrix6d P = Matrix6d::Identity();
      P(axis, axis) = 1e-10;
      covariances.push_back({at_image(k), P});
    }
    return covariances;
  }
  [[nodiscard]] std::string html(const std::vector<StampedCovariance>& covariances) const {
    const PlotPage page = evaluation_plots("e", run_, covariances, evaluation_);
    EXPECT_EQ(test::xml_fault(to_html(page, kNoScript)), "");
    return to_html(page, kScript);
  }

  Evaluation evaluation_;
  RunResults run_;
};

TEST_F(EvaluationPlots, BandIsInTheAxesOfTheErrors) {
  // The error lies along -y of the tag's axes, which is x of W.
  EXPECT_THAT(html(certain_along(0)), HasSubstr("66.7 % of the"));
  EXPECT_THAT(html(certain_along(1)), HasSubstr("100.0 % of the"));
}

TEST_F(EvaluationPlots, ReportErrorsAndWhatIsLeftOut) {
  EXPECT_THAT(html({}),
              AllOf(HasSubstr("Position error against truth: 1.00 mm RMSE, worst 2.00 mm"),
                    HasSubstr("left out"), Not(HasSubstr("3 sigma"))));
}

TEST_F(EvaluationPlots, WithoutTruthShowSigmasMapAndReprojection) {
  evaluation_.against = Evaluation::Against::kNothing;
  evaluation_.pose.reset();
  evaluation_.traces.differences.clear();
  evaluation_.traces.settled_at.reset();
  EXPECT_THAT(html(certain_along(0)),
              AllOf(HasSubstr("Sigmas of the filter"), HasSubstr("Map from above"),
                    HasSubstr("Reprojection error")));
  evaluation_ = {};
  run_ = {};
  EXPECT_THAT(html({}), HasSubstr("Map from above"));
}

}  // namespace
}  // namespace fiducap
