// Which of several wrong parameters explain the data, and what a map changes of that.
#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <vector>

#include "world/calibration_fixture.hpp"

namespace fiducap::world {
namespace {

using testing::Each;
using testing::Field;
using Kind = FoundMismatch::Kind;

constexpr std::size_t kSizeOfAll = 5;  // after four numbers of the lens and the readout

TEST_F(CalibrationMonitorTest, TwoCausesThatExplainTheDataEquallyAreOpenedAndAmbiguous) {
  const int accel = layout::accel_scale(1) + 2;
  auto P = state_.P();
  Eigen::VectorXd h = Eigen::VectorXd::Zero(state_.size());
  h(size_) = h(accel) = 1e-3;  // the data depend on their sum alone
  const double S = h.dot(P * h) + 1e-12;
  const Eigen::VectorXd K = P * h / S;
  P -= (K * K.transpose() * S).eval();
  state_.add_error(K * 2e-5);
  test_parameters();
  const auto named = found(monitor_);
  ASSERT_GE(named.size(), 2u);
  std::vector<Kind> kinds;
  for (const FoundMismatch& one : named) {
    EXPECT_TRUE(one.is_ambiguous);
    kinds.push_back(one.kind);
  }
  EXPECT_THAT(kinds, testing::IsSupersetOf({Kind::kAllPrints, Kind::kAccelScale}));
}

TEST_F(CalibrationMonitorTest, AMountToldExactIsTested) {
  mounts_[0].position_sigma_m = 1e-4;
  mounts_[0].rotation_sigma_rad = 1e-4;
  state_.reset({mounts_[0].X_BV});
  auto own = state_.P().block<6, 6>(layout::camera(0), layout::camera(0));
  own.diagonal().setConstant(1e-8);
  CalibrationMonitor monitor(sensors_, {});
  monitor.begin(state_);
  own *= 0.5;  // by images, which have moved it
  state_.X_BV[0].p.x() += 2e-3;
  for (int i = 0; i < 25; ++i) monitor.update_tests(state_, 0, 1.0);
  EXPECT_NEAR(state_.X_BV[0].p.x(), 4e-3, 2e-4) << "without the prior";
  EXPECT_THAT(monitor.found_wrong(state_),
              testing::Contains(testing::FieldsAre(Kind::kMountPosition, 0)));
}

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
  EXPECT_NEAR(variance(size_) / before[kSizeOfAll].variance, 1, 1e-3);
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

TEST_F(CalibrationMonitorTest, OpensTheParametersThatAMapNames) {
  KnownMap map;
  map.wrong_prints = {KnownMap::kAllPrints};
  map.wrong_lenses = {{2, 0, Kind::kFocalLength}};  // another body's
  EXPECT_TRUE(monitor_.follow_map(state_, map, 1));
  EXPECT_TRUE(state_.parameter_tests[kSizeOfAll].is_open);
  EXPECT_FALSE(monitor_.lens(state_, 0).is_estimated());
  EXPECT_FALSE(monitor_.follow_map(state_, map, 1)) << "it is open by now";
}

}  // namespace
}  // namespace fiducap::world
