// Parameter tests after an exchange with the map, and the results of the map.
#include <chrono>
#include <cmath>

#include "world/calibration_monitor_fixture.hpp"

namespace fiducap::world {
namespace {

TEST_F(CalibrationMonitorTest, AnExchangeWithTheMapDoesNotRaiseAScore) {
  measure(1e-3, 3e-7, 1e-6);
  const auto before = monitor_.test_statistics(state_);
  const double size = state_.sizes.common;
  // Adopting a map changes the value and loses its information.
  state_.sizes.common += 4e-4;
  state_.clear_column(size_, 4e-4);
  monitor_.restore_test_statistics(state_, before);
  EXPECT_NEAR(state_.sizes.common, 0, 1e-6) << "lost statistics are no evidence";
  test_parameters();
  EXPECT_LT(std::abs(state_.sizes.common), 1e-5 + std::abs(size)) << "it is not opened";
}

TEST_F(CalibrationMonitorTest, AnExchangeWithTheMapDoesNotResetATest) {
  measure_larger_prints();
  const auto before = monitor_.test_statistics(state_);
  const double size = state_.sizes.common;
  // The map reports no error with certainty.
  state_.sizes.common = 0;
  state_.clear_column(size_, 1e-6);
  monitor_.restore_test_statistics(state_, before);
  EXPECT_NEAR(state_.sizes.common, size, 1e-3 * size);
  const double known = before[kSizeOfAll].variance;
  EXPECT_NEAR(variance(size_), known, 1e-3 * known);
}

TEST_F(CalibrationMonitorTest, AResetKeepsOpenParameters) {
  measure_larger_prints();
  FilterState closed = state_;
  monitor_.reset_tests(closed);
  EXPECT_NEAR(closed.sizes.common, 0, 1e-15);
  EXPECT_NEAR(std::sqrt(closed.P()(size_, size_)), 4e-4, 1e-12);
  test_parameters();
  const double opened = state_.sizes.common;
  ASSERT_GT(opened, 0.01);
  monitor_.reset_tests(state_);
  EXPECT_EQ(state_.sizes.common, opened);
}

TEST_F(CalibrationMonitorTest, AJudgedMapResetsTheTestsAndDecidesAloneForTenSeconds) {
  KnownMap map;
  monitor_.follow_map(state_, map, 1);
  measure_larger_prints();
  FilterState unjudged = state_;
  monitor_.follow_map(unjudged, map, 1);
  EXPECT_EQ(unjudged.sizes.common, state_.sizes.common) << "the map was not tested";
  map.is_judged = true;
  EXPECT_FALSE(monitor_.follow_map(state_, map, 1));
  EXPECT_NEAR(state_.sizes.common, 0, 1e-15);
  EXPECT_LT(variance(kFocal), 2.6e-9) << "keeps the information of its images";
  place_ = 0;
  measure_larger_prints();
  test_parameters();
  EXPECT_THAT(state_.parameter_tests, testing::Each(is_closed()));
  EXPECT_GT(monitor_.unmodelled_covariance(state_).trace(), 0) << "but may be wrong";
  state_.time += std::chrono::seconds(11);
  test_parameters();
  EXPECT_TRUE(state_.parameter_tests[kSizeOfAll].is_open) << "by its own images";
}

TEST_F(CalibrationMonitorTest, OpensTheParametersThatAJudgedMapNames) {
  KnownMap map;
  map.is_judged = true;
  map.wrong_prints = {KnownMap::kAllPrints};
  map.wrong_lenses = {{2, 0, FoundMismatch::Kind::kFocalLength}};  // another body's
  EXPECT_TRUE(monitor_.follow_map(state_, map, 1));
  EXPECT_TRUE(state_.parameter_tests[kSizeOfAll].is_open);
  EXPECT_FALSE(monitor_.lens(state_, 0).is_estimated());
  EXPECT_FALSE(monitor_.follow_map(state_, map, 1)) << "it is open by now";
}

}  // namespace
}  // namespace fiducap::world
