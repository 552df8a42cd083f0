// The quick form of the paper's first experiment, end to end: rendered, detected, filtered, drawn.
#include <gtest/gtest.h>

#include "paper/paper_run.hpp"

namespace fiducap::bench {
namespace {

const PaperFigure& figure(const PaperResult& result, const std::string& what) {
  for (const PaperFigure& one : result.figures) {
    if (one.what == what) return one;
  }
  throw std::runtime_error("no figure " + what);
}

TEST(PaperExperiments, BothFiltersMapTheTableFromImages) {
  PaperOptions options;
  options.quick = true;
  const PaperResult result = table_experiment(options);
  for (std::size_t f = 0; f < options.filters.size(); ++f) {
    SCOPED_TRACE(options.filters[f]);
    // After 20 s of 60: twice the goal of the whole run.
    EXPECT_LT(figure(result, "tag distance error, end").ours[f].rms, 2 * 0.5);
    EXPECT_LT(figure(result, "tag rotation error, end").ours[f].rms, 2 * 0.1);
    // Half of the error of the authors' code over 60 s.
    EXPECT_LT(figure(result, "position RMSE").ours[f].rms, 0.5 * 18.0);
    EXPECT_GT(figure(result, "position RMSE").ours[f].rms, 0);
  }
  ASSERT_EQ(result.plots.size(), 3u);
  for (const LinePlot& plot : result.plots) {
    ASSERT_FALSE(plot.panels.empty());
    EXPECT_GT(plot.panels.front().lines.front().points.size(), 100u) << plot.title;
  }
}

}  // namespace
}  // namespace fiducap::bench
