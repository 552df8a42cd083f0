#include "base/numeric.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

TEST(DurationHistogram, GivesQuantilesWithinABin) {
  DurationHistogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), Duration{0});
  for (int us = 1; us <= 1000; ++us) histogram.add(std::chrono::microseconds(10 * us));
  EXPECT_EQ(histogram.count(), 1000u);
  constexpr double kBin = 0.03;
  EXPECT_NEAR(to_seconds(histogram.quantile(0.5)), 5e-3, kBin * 5e-3);
  EXPECT_NEAR(to_seconds(histogram.quantile(0.99)), 9.9e-3, kBin * 9.9e-3);
}

TEST(DurationHistogram, TakesWhatIsTooShortAndTooLongInItsLastBins) {
  DurationHistogram histogram;
  histogram.add(Duration{-5});
  EXPECT_LT(histogram.quantile(1), std::chrono::microseconds(2));
  histogram.add(std::chrono::hours(100));
  EXPECT_GT(histogram.quantile(1), std::chrono::minutes(20));
}

TEST(Parabola, IsLowestAtItsVertexAtMostOneStepAway) {
  const auto values = [](double x) { return 3 * (x - 0.3) * (x - 0.3) + 2; };
  EXPECT_NEAR(minimum_of_parabola(values(-1), values(0), values(1)), 0.3, 1e-12);
  EXPECT_EQ(minimum_of_parabola(9, 5, 1.1), 1.0);
}

TEST(Parabola, ThatBendsTheOtherWayStaysInTheMiddle) {
  EXPECT_EQ(minimum_of_parabola(1, 2, 1), 0.0);
  EXPECT_EQ(minimum_of_parabola(1, 1, 1), 0.0);
}

}  // namespace
}  // namespace fiducap
