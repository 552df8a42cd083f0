#include "tools/replay/run_plots.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>

#include "base/pose.hpp"
#include "base/whole_file.hpp"
#include "support/temporary_folder.hpp"
#include "support/well_formed.hpp"

namespace fiducap {
namespace {

using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pair;

const Expected<std::string> kPlotScript{"draw()"};

Instant at_image(int k) { return instant_from_ns(1'000'000'000'000) + k * milliseconds(50); }

std::vector<StampedPose> poses(const std::vector<int>& images) {
  std::vector<StampedPose> out;
  for (const int k : images) out.push_back({at_image(k), {{1, 0, 0, 0}, {0.01 * k, 1, 0}}});
  return out;
}

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

TEST(PosePlots, GapsAreWhereMoreThanTwoImagesInARowHaveNoPose) {
  const auto spans = [](const std::vector<int>& images) {
    return missing_poses(poses(images), at_image(0), at_image(20), at_image(0)).from_to;
  };
  EXPECT_THAT(spans({0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 20}),
              IsEmpty());
  constexpr double kFrom_s = 0.2;  // image 4
  constexpr double kTo_s = 0.5;    // image 10
  const auto gap = spans({0, 1, 2, 3, 4, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20});
  ASSERT_EQ(gap.size(), 1u);
  EXPECT_DOUBLE_EQ(gap[0].first, kFrom_s);
  EXPECT_DOUBLE_EQ(gap[0].second, kTo_s);
  EXPECT_THAT(spans({10, 11, 12}), ElementsAre(Pair(0, 0.5), Pair(testing::DoubleEq(0.6), 1)))
      << "both ends";
  EXPECT_THAT(spans({}), ElementsAre(Pair(0, 1)));
}

TEST(PosePlots, ATagOnAWallIsAStrokeFromAbove) {
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
    return to_html(run_plots(bodies, session_), kPlotScript);
  }
  OfflineSetup setup_;
  OfflineResult result_{result()};
  OfflineSession session_;
};

TEST_F(RunPlots, ShowAllBodiesWithWhatHappened) {
  const std::string html = page();
  for (const char* there :
       {"Map from above: 2 tags", "path of rover\\u003c1>", "arm over time", "no pose", "restarted",
        "tags in the image", "\"17\"", "tags seem &lt;larger&gt; &amp; wider", "position σ, mm"})
    EXPECT_THAT(html, HasSubstr(there));
}

TEST_F(RunPlots, WithoutAnyImageThereIsAPageAllTheSame) {
  result_ = {};
  EXPECT_THAT(page(), HasSubstr("Map from above"));
}

TEST_F(RunPlots, NumbersThatAreNoneAreNotDrawn) {
  result_.trajectory[3].X_WB.p.x() = std::numeric_limits<double>::quiet_NaN();
  result_.covariances[5].covariance(0, 0) = -1;
  EXPECT_THAT(page(), AllOf(HasSubstr("null"), Not(HasSubstr("nan"))));
}

TEST_F(RunPlots, BelongToTheRun) {
  const TemporaryFolder folder;
  const std::vector<RunBody> bodies{{"rover", "", &setup_, &result_}};
  ASSERT_TRUE(write_run_files(folder.file("out"), bodies, session_, "<html/>"));
  EXPECT_EQ(read_whole_file(folder.file("out/plots.html")).value(), "<html/>");
  EXPECT_THAT(read_whole_file(folder.file("out/report.json")).value(), HasSubstr("plots.html"));
  ASSERT_TRUE(write_run_files(folder.file("out"), bodies, session_));
  EXPECT_FALSE(std::filesystem::exists(folder.file("out/plots.html")))
      << "those of an earlier run would be mixed with this one";
  ASSERT_TRUE(write_whole_file(folder.file("other/plots.html"), "<html/>"));
  EXPECT_FALSE(check_run_folder(folder.file("other"))) << "it may be of another run";
}

TEST_F(RunPlots, AnHourOfTwentyHertzIsWrittenInNoTimeAndSmall) {
  result_ = {};
  for (int k = 0; k < 72'000; ++k) {
    result_.images.push_back({at_image(k), k % 7});
    const double turn = 0.01 * k;
    result_.trajectory.push_back(
        {at_image(k), {{1, 0, 0, 0}, {3 * std::cos(turn), 3 * std::sin(1.1 * turn), 1}}});
    result_.covariances.push_back({at_image(k), Matrix6d::Identity() * (1e-6 + 1e-7 * (k % 13))});
  }
  constexpr std::size_t kSmall = 5'000'000;  // bytes, two bodies
  EXPECT_LT(page().size(), kSmall);
}

/// Errors of a millimetre along x of W; the axes of the tag are turned by a quarter about z.
Evaluation evaluation() {
  Evaluation e;
  e.against = Evaluation::Against::kTruth;
  e.reference_tag = 3;
  e.pose = PoseErrors{90, 0.001, 0.002, 0.01, 0.02};
  e.traces.first_image = at_image(0);
  e.traces.last_image = at_image(199);
  e.traces.settled_at = at_image(100);
  e.traces.X_WA = {exp_so3({0, 0, 1.5707963267948966}), {0, 0, 0}};
  for (int k = 100; k < 200; ++k)
    e.traces.differences.push_back({at_image(k), {0, -1e-3, 0}, Eigen::Vector3d::Zero()});
  e.traces.reprojection_px = {0.1, 0.2, 0.3, 40};
  return e;
}

RunResults run_of_evaluation() {
  RunResults run;
  for (int k = 0; k < 200; ++k) run.trajectory.push_back({at_image(k), {}});
  run.map = {{3, 0.2, {}}};
  return run;
}

std::vector<StampedCovariance> sure_along(int axis) {
  std::vector<StampedCovariance> covariances;
  for (int k = 0; k < 200; ++k) {
    Matrix6d P = Matrix6d::Identity();
    P(axis, axis) = 1e-10;
    covariances.push_back({at_image(k), P});
  }
  return covariances;
}

std::string text_of(const PlotPage& page) {
  EXPECT_EQ(test::xml_fault(to_html(page, fail(ErrorCode::kNotFound, "none"))), "");
  return to_html(page, kPlotScript);
}

TEST(EvaluationPlots, TheBandIsTurnedIntoTheAxesOfTheErrors) {
  // The error lies along -y of the tag's axes, which is x of W.
  const auto page = [&](int axis) {
    return text_of(evaluation_plots("e", run_of_evaluation(), sure_along(axis), evaluation()));
  };
  EXPECT_THAT(page(0), HasSubstr("66.7 % of the"));
  EXPECT_THAT(page(1), HasSubstr("100.0 % of the"));
}

TEST(EvaluationPlots, SayTheNumbersAndWhatIsLeftOut) {
  const std::string html = text_of(evaluation_plots("e", run_of_evaluation(), {}, evaluation()));
  EXPECT_THAT(html, HasSubstr("Position error against truth: 1.00 mm RMSE, worst 2.00 mm"));
  EXPECT_THAT(html, HasSubstr("left out"));
  EXPECT_THAT(html, Not(HasSubstr("3 sigma"))) << "there is no covariance";
}

TEST(EvaluationPlots, WithoutTruthShowWhatThereIs) {
  Evaluation e = evaluation();
  e.against = Evaluation::Against::kNothing;
  e.pose.reset();
  e.traces.differences.clear();
  e.traces.settled_at.reset();
  const std::string html = text_of(evaluation_plots("e", run_of_evaluation(), sure_along(0), e));
  EXPECT_THAT(html, HasSubstr("Sigmas of the filter"));
  EXPECT_THAT(html, HasSubstr("Map from above"));
  EXPECT_THAT(html, HasSubstr("Reprojection error"));
  EXPECT_THAT(text_of(evaluation_plots("e", {}, {}, Evaluation{})), HasSubstr("Map from above"));
}

}  // namespace
}  // namespace fiducap
