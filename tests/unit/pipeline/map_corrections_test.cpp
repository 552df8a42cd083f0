#include "pipeline/correction_ramp.hpp"

#include <gtest/gtest.h>

#include "base/pose.hpp"

namespace fiducap {
namespace {

BodyEstimate estimate(double sigma_m = 0.002) {
  BodyEstimate e;
  e.X_WB.p = {100, 0, 0};
  e.anchored = true;
  e.covariance = Matrix15d::Identity() * sigma_m * sigma_m;
  return e;
}

UpdateReport shifted(const Pose& X_new_old, int generation = 0) {
  UpdateReport report;
  report.generation = generation;
  report.map_shift = X_new_old;
  return report;
}

Pose aside(double metres) { return {Eigen::Quaterniond::Identity(), {0, metres, 0}}; }

TEST(MapCorrections, SaysHowFarTheBodyWasMovedNotTheOrigin) {
  MapCorrections corrections;
  const Pose turned{exp_so3({0, 0, 2e-4}), {0, 0, 0}};
  EXPECT_EQ(corrections.add(shifted(turned), estimate()),
            "a correction of the map has moved it by 20 mm and 0.01 degrees");
  EXPECT_EQ(corrections.add(UpdateReport{}, estimate()), "");
}

TEST(MapCorrections, SmallOnesAddUpUntilTheyAreWorthAWord) {
  MapCorrections corrections;
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(corrections.add(shifted(aside(0.003)), estimate()), "") << i;
  EXPECT_NE(corrections.add(shifted(aside(0.003)), estimate()), "");
  EXPECT_EQ(corrections.add(shifted(aside(0.003)), estimate()), "") << "counted anew";
}

TEST(MapCorrections, ThoseBackAndForthAreNone) {
  MapCorrections corrections;
  for (int i = 0; i < 100; ++i)
    EXPECT_EQ(corrections.add(shifted(aside(i % 2 == 0 ? 0.008 : -0.008)), estimate()), "");
}

TEST(MapCorrections, WhatABodyWasUnsureOfIsNoNews) {
  MapCorrections corrections;
  EXPECT_EQ(corrections.add(shifted(aside(0.03)), estimate(0.05)), "");
}

TEST(MapCorrections, ABodyThatBeginsAnewOrHasNoPlaceIsNotCorrected) {
  MapCorrections corrections;
  EXPECT_EQ(corrections.add(shifted(aside(0.5)), std::nullopt), "");
  EXPECT_EQ(corrections.add(shifted(aside(0.5), 1), estimate()), "");
  EXPECT_NE(corrections.add(shifted(aside(0.5), 1), estimate()), "");
}

}  // namespace
}  // namespace fiducap
