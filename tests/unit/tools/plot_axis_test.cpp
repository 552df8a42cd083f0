#include "tools/plot/plot_axis.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace fiducap {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRoundingOfShare = 1e-12;

PlotAxis axis_of(std::vector<double> values, PlotAxis::Scale scale, PlotAxis::Ends ends) {
  PlotAxis axis(scale);
  for (const double value : values) axis.add(value);
  axis.finish(5, ends);
  return axis;
}

std::vector<std::string> texts(const PlotAxis& axis) {
  std::vector<std::string> out;
  for (const PlotTick& tick : axis.ticks())
    if (!tick.text.empty()) out.push_back(tick.text);
  return out;
}

TEST(PlotAxis, LinearTicksAreRoundNumbersWithAsManyDecimalsAsTheyNeed) {
  const auto ticks = [](double low, double high) {
    return texts(axis_of({low, high}, PlotAxis::Scale::kLinear, PlotAxis::Ends::kRound));
  };
  EXPECT_THAT(ticks(0, 10), ElementsAre("0", "2", "4", "6", "8", "10"));
  EXPECT_THAT(ticks(-0.11, 0.1), ElementsAre("-0.15", "-0.10", "-0.05", "0", "0.05", "0.10"));
  EXPECT_THAT(ticks(1e9, 1e9 + 5e8),
              ElementsAre("1e+09", "1.1e+09", "1.2e+09", "1.3e+09", "1.4e+09", "1.5e+09"));
}

TEST(PlotAxis, RoundEndsHoldAllValues) {
  for (const double high : {0.3, 0.7, 1.0, 3.3, 9.99, 10.01, 123.4}) {
    const PlotAxis axis =
        axis_of({-high / 7, high}, PlotAxis::Scale::kLinear, PlotAxis::Ends::kRound);
    EXPECT_LE(axis.low(), -high / 7);
    EXPECT_GE(axis.high(), high);
    EXPECT_NEAR(axis.share(axis.low()), 0, kRoundingOfShare);
    EXPECT_NEAR(axis.share(axis.high()), 1, kRoundingOfShare);
  }
}

TEST(PlotAxis, LogarithmicTicksArePowersOfTen) {
  const PlotAxis axis = axis_of({0.004, 20}, PlotAxis::Scale::kLogarithmic, PlotAxis::Ends::kRound);
  EXPECT_THAT(texts(axis), ElementsAre("10⁻³", "10⁻²", "10⁻¹", "10⁰", "10¹", "10²"));
  EXPECT_NEAR(axis.share(1), 0.6, kRoundingOfShare);
}

TEST(PlotAxis, WhatCannotBeShownDoesNotMoveIt) {
  for (const auto scale : {PlotAxis::Scale::kLinear, PlotAxis::Scale::kLogarithmic}) {
    const PlotAxis axis =
        axis_of({1, kNone, kInfinity, 10, -kInfinity}, scale, PlotAxis::Ends::kAsGiven);
    EXPECT_EQ(axis.low(), 1);
    EXPECT_EQ(axis.high(), 10);
    EXPECT_FALSE(axis.can_show(kNone));
  }
  const PlotAxis axis =
      axis_of({0, -3, 2, 5}, PlotAxis::Scale::kLogarithmic, PlotAxis::Ends::kAsGiven);
  EXPECT_EQ(axis.low(), 2);
  EXPECT_FALSE(axis.can_show(0));
}

TEST(PlotAxis, NoValuesAndASingleOneGiveARange) {
  for (const auto scale : {PlotAxis::Scale::kLinear, PlotAxis::Scale::kLogarithmic})
    for (const auto& values : {std::vector<double>{}, {7.0}, {1e-300}, {1e12, 1e12}}) {
      const PlotAxis axis = axis_of(values, scale, PlotAxis::Ends::kAsGiven);
      EXPECT_LT(axis.low(), axis.high());
      EXPECT_THAT(axis.ticks(), ::testing::Not(IsEmpty()));
      EXPECT_LT(axis.ticks().size(), 50u);
    }
}

}  // namespace
}  // namespace fiducap
