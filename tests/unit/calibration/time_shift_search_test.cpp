#include "calibration/extrinsics/camera_imu_calibration.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace fiducap {
namespace {

constexpr double kSigma_s = 1e-4;

/// A chi-square around `truth` with a ripple of a few units, as caused by gates of a filter.
ShiftCost jagged(double truth_s) {
  return [truth_s](double s) -> Expected<double> {
    const double off = (s - truth_s) / kSigma_s;
    return 1e4 + off * off + 3 * std::sin(s * 4e4);
  };
}

TEST(TimeShiftSearch, FindsTheMinimumOfAJaggedCostWithItsSigma) {
  for (const double truth : {-0.0437, -0.012, 0.0, 0.00021, 0.031}) {
    const auto found = search_time_shift(jagged(truth), 0.05);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->shift_s, truth, kSigma_s) << truth;  // ripple of 3 on curvature 1/σ²
    EXPECT_NEAR(found->sigma_s, kSigma_s, 0.1 * kSigma_s) << truth;
    EXPECT_TRUE(found->determined);
    EXPECT_FALSE(found->at_border);
  }
}

TEST(TimeShiftSearch, AFlatCostIsNotDetermined) {
  const auto found =
      search_time_shift([](double s) -> Expected<double> { return 5 - 900 * s; }, 0.05);
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->determined);
  EXPECT_FALSE(found->at_border);
  EXPECT_EQ(found->shift_s, 0);
}

TEST(TimeShiftSearch, ReportsAMinimumOutsideOfTheRange) {
  const auto found = search_time_shift(jagged(0.09), 0.05);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->at_border);
  const auto concave =
      search_time_shift([](double s) -> Expected<double> { return -1e3 * std::exp(40 * s); }, 0.05);
  ASSERT_TRUE(concave);
  EXPECT_TRUE(concave->at_border);
  EXPECT_FALSE(concave->determined);
  EXPECT_EQ(concave->shift_s, 0);
}

TEST(TimeShiftSearch, ReturnsTheErrorOfACostAndStops) {
  int asked = 0;
  const auto found = search_time_shift(
      [&](double) -> Expected<double> {
        ++asked;
        return fail(ErrorCode::kInvalid, "no more");
      },
      0.05);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().what, "no more");
  EXPECT_EQ(asked, 1);
}

}  // namespace
}  // namespace fiducap
