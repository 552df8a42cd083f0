// The quick form of the paper's first experiment, end to end: rendered, detected, filtered, drawn.
#include <gtest/gtest.h>

#include <cmath>

#include "paper/experiments.hpp"
#include "paper/mocap.hpp"

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

TEST(Mocap, DifferencesHaveTheNoiseOfTwoPoses) {
  SimulatedDataSetup setup;
  setup.world = "table";
  setup.seconds = 20;
  const EstimationData data = simulate(setup);
  const MocapNoise noise;
  double v = 0;
  double w = 0;
  const auto differences = differences_of(data, noise, 1);
  ASSERT_GT(differences.size(), 1900u);
  for (const PoseDifference& d : differences) {
    v += (d.v_B - d.v_B_true).squaredNorm() / (3.0 * static_cast<double>(differences.size()));
    w += (d.w_B - d.w_B_true).squaredNorm() / (3.0 * static_cast<double>(differences.size()));
  }
  constexpr double kStep_s = 0.01;
  constexpr double kShare = 0.05;  // 6000 numbers: 1.3 % would be 1 sigma, neighbours are related
  EXPECT_NEAR(std::sqrt(v), std::sqrt(2.0) * noise.position_m / kStep_s,
              kShare * std::sqrt(2.0) * noise.position_m / kStep_s);
  EXPECT_NEAR(std::sqrt(w), std::sqrt(2.0) * noise.rotation_rad / kStep_s,
              kShare * std::sqrt(2.0) * noise.rotation_rad / kStep_s);
}

}  // namespace
}  // namespace fiducap::bench
