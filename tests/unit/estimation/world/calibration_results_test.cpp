// Results of the parameter tests after the map was adopted, and the results of the map.
#include <chrono>
#include <cmath>

#include "world/calibration_monitor_fixture.hpp"

namespace fiducap::world {
namespace {

TEST_F(CalibrationMonitorTest, AnExchangeWithTheMapDoesNotRaiseAScore) {
  measure(1e-3, 3e-7, 1e-6);
  const auto before = monitor_.test_statistics(state_);
  const double size = state_.sizes.common;
  // What taking over a map does: the value goes elsewhere, and what was known of it is lost.
  state_.sizes.common += 4e-4;
  state_.clear_column(size_, 4e-4);
  monitor_.restore_test_statistics(state_, before);
  EXPECT_NEAR(state_.sizes.common, 0, 1e-6) << "test_statistics that is lost says nothing";
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  EXPECT_LT(std::abs(state_.sizes.common), 1e-5 + std::abs(size)) << "it is not opened";
}

TEST_F(CalibrationMonitorTest, AnExchangeWithTheMapDoesNotResetATest) {
  measure(1e-3, 2e-5, 1e-6);
  const auto before = monitor_.test_statistics(state_);
  const double size = state_.sizes.common;
  // The map reports no error, with certainty.
  state_.sizes.common = 0;
  state_.clear_column(size_, 1e-6);
  monitor_.restore_test_statistics(state_, before);
  EXPECT_NEAR(state_.sizes.common, size, 1e-3 * size);
  EXPECT_NEAR(state_.P()(size_, size_), before[kSizeOfAll].variance,
              1e-3 * before[kSizeOfAll].variance);
}

TEST_F(CalibrationMonitorTest, AResetConcernsOnlyClosedParameters) {
  measure(1e-3, 2e-5, 1e-6);
  FilterState closed = state_;
  monitor_.reset_tests(closed);
  EXPECT_NEAR(closed.sizes.common, 0, 1e-15);
  EXPECT_NEAR(std::sqrt(closed.P()(size_, size_)), 4e-4, 1e-12);
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  const double opened = state_.sizes.common;
  ASSERT_GT(opened, 0.01);
  monitor_.reset_tests(state_);
  EXPECT_EQ(state_.sizes.common, opened);
}

TEST_F(CalibrationMonitorTest, AJudgedMapResetsTheOtherTestsAndIsTheOnlyOneToOpen) {
  KnownMap map;
  monitor_.follow_map(state_, map, 1);
  measure(1e-3, 2e-5, 1e-6);
  const double accused = state_.sizes.common;
  FilterState unjudged = state_;
  monitor_.follow_map(unjudged, map, 1);
  EXPECT_EQ(unjudged.sizes.common, accused) << "nobody has looked";
  map.is_judged = true;
  EXPECT_FALSE(monitor_.follow_map(state_, map, 1));
  EXPECT_NEAR(state_.sizes.common, 0, 1e-15);
  const double known = state_.P()(layout::focal(0), layout::focal(0));
  EXPECT_LT(known, 2.6e-9) << "what is not accused keeps what images said of it";
  place_ = 0;
  measure(1e-3, 2e-5, 1e-6);
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  for (const ParameterTest& test : state_.parameter_tests) EXPECT_FALSE(test.is_open);
  EXPECT_GT(monitor_.unmodelled_covariance(state_).trace(), 0) << "but it is told that it may be";
  state_.time += std::chrono::seconds(11);
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  EXPECT_TRUE(state_.parameter_tests[kSizeOfAll].is_open)
      << "no word from the map: by its own images";
}

TEST_F(CalibrationMonitorTest, OpensWhatAJudgedMapNames) {
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
