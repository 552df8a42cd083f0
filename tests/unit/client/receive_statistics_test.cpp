#include "src/receive_statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fiducap::sdk {
namespace {

TEST(ReceiveStatistics, KnowsNothingAtFirst) {
  const ReceiveStatistics statistics;
  EXPECT_EQ(statistics.rate_hz(kSecond), 0.0);
  EXPECT_TRUE(std::isnan(statistics.latency_quantile_s(0.5)));
}

TEST(ReceiveStatistics, CountsTheFramesOfTheLastSecond) {
  ReceiveStatistics statistics;
  Nanoseconds now = 100 * kSecond;
  for (int i = 0; i < 300; ++i) statistics.add(now += 10 * kMillisecond, 0.001);
  EXPECT_EQ(statistics.rate_hz(now), 100.0);
  EXPECT_EQ(statistics.rate_hz(now + kSecond / 2), 50.0);
  EXPECT_EQ(statistics.rate_hz(now + 2 * kSecond), 0.0);
}

TEST(ReceiveStatistics, MeasuresRatesAboveItsMemory) {
  ReceiveStatistics statistics;
  Nanoseconds now = 100 * kSecond;
  for (int i = 0; i < 5000; ++i) statistics.add(now += kMillisecond / 4, 0.001);
  constexpr double kOneFrame_hz = 5.0;  // the edge of the window cuts one frame of a thousand
  EXPECT_NEAR(statistics.rate_hz(now), 4000.0, kOneFrame_hz);
}

TEST(ReceiveStatistics, GivesQuantilesOfTheLastThousand) {
  ReceiveStatistics statistics;
  for (int i = 0; i < 500; ++i) statistics.add(i, 7.0);
  for (int i = 1; i <= 1000; ++i) statistics.add(i, i * 1e-3);
  EXPECT_DOUBLE_EQ(statistics.latency_quantile_s(0.50), 0.500);
  EXPECT_DOUBLE_EQ(statistics.latency_quantile_s(0.99), 0.990);
  EXPECT_DOUBLE_EQ(statistics.latency_quantile_s(1.0), 1.0);
}

TEST(ReceiveStatistics, LeavesOutFramesWithoutACommonClock) {
  ReceiveStatistics statistics;
  statistics.add(1, std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(std::isnan(statistics.latency_quantile_s(0.5)));
  statistics.add(2, 0.25);
  EXPECT_EQ(statistics.latency_quantile_s(0.5), 0.25);
}

}  // namespace
}  // namespace fiducap::sdk
