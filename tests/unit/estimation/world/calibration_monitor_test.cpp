// Configured parameters are tested, estimated when the data contradict them, fixed when they do
// not.
#include <gmock/gmock.h>

#include <chrono>
#include <cmath>

#include "support/jacobian_check.hpp"
#include "world/calibration_fixture.hpp"

namespace fiducap::world {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;
using Kind = FoundMismatch::Kind;

TEST_F(CalibrationMonitorTest, OpensWhatAnotherFilterFoundWrongButTagSizes) {
  const FilterState fresh = state_;
  measure_larger_prints();
  test_parameters();
  ASSERT_GT(std::abs(state_.sizes.common), 0.01) << "it is open";
  EXPECT_THAT(monitor_.found_wrong(state_), IsEmpty());
  state_ = fresh;
  const std::vector<WrongNumber> wrong{{Kind::kFocalLength, 0},
                                       {Kind::kCentreU, 1}};  // no such camera
  monitor_.open_found(state_, wrong);
  EXPECT_NEAR(monitor_.lens(state_, 0).focal_sigma, 0.05, 1e-12);
  EXPECT_EQ(monitor_.lens(state_, 0).centre_sigma_px, Eigen::Vector2d::Zero());
  EXPECT_THAT(monitor_.found_wrong(state_), ElementsAre(testing::FieldsAre(Kind::kFocalLength, 0)));
}

TEST_F(CalibrationMonitorTest, AnOpenedParameterIsAsIfItHadAlwaysBeenOpen) {
  const FilterState closed = state_;
  state_.clear_column(size_, 0.05);
  measure_larger_prints();
  const double size = state_.sizes.common;
  const Eigen::MatrixXd P = state_.P();
  state_ = closed;
  measure_larger_prints();
  EXPECT_LT(std::abs(state_.sizes.common), 0.1 * size) << "the prior holds it";
  test_parameters();
  EXPECT_NEAR(state_.sizes.common, size, 1e-3 * size);
  // Known to a half of it at best, correlated states likewise: only along its column.
  const Eigen::VectorXd along = P.col(size_) / P(size_, size_);
  const double more = 0.25 * size * size - P(size_, size_);
  expect_matrices_near(state_.P(), P + more * along * along.transpose(), 5e-3);
  EXPECT_THAT(found(monitor_), IsEmpty()) << "later images decide";
  measure_larger_prints();
  const auto mismatches = found(monitor_);
  ASSERT_THAT(mismatches, ElementsAre(Field(&FoundMismatch::kind, Kind::kAllPrints)));
  EXPECT_NEAR(mismatches[0].value, 0.02, 0.003);
}

TEST_F(CalibrationMonitorTest, ConfirmsOnceTheDataDetermineAllParameters) {
  const auto know = [&](int column, double sigma) {
    variance(column) = 1 / (1 / variance(column) + 1 / (sigma * sigma));
  };
  EXPECT_FALSE(monitor_.are_confirmed(state_, 0)) << "no image";
  know(kFocal, 1e-3);
  know(layout::centre(0), 0.5);
  know(layout::centre(0) + 1, 0.5);
  know(layout::distortion(0), 2e-3);
  know(kReadout, 3e-4);
  EXPECT_FALSE(monitor_.are_confirmed(state_, 0)) << "prints may be of another size";
  know(size_, 5e-4);
  EXPECT_TRUE(monitor_.are_confirmed(state_, 0));
  state_.lenses[0].focal = 1e-5;  // of a prior of 5e-5: 4 sigma where it is known to 1e-3
  EXPECT_FALSE(monitor_.are_confirmed(state_, 0));
}

TEST_F(CalibrationMonitorTest, TestsAllCamerasOfMany) {
  constexpr int kCameras = 16;  // 15 rows each: more than one test holds
  mounts_.assign(kCameras, {});
  for (CameraMount& mount : mounts_) mount.position_sigma_m = mount.rotation_sigma_rad = 1e-4;
  state_.reset(std::vector<Pose>(kCameras));
  for (int c = 0; c < kCameras; ++c)
    state_.P().diagonal().segment<6>(layout::camera(c)).setConstant(1e-8);
  CalibrationMonitor monitor(sensors_, {});
  monitor.begin(state_);
  std::vector<WrongNumber> wrong;
  for (const int camera : {15, 0, 7}) {  // what is open stays open
    variance(layout::focal(camera)) /= 2;
    state_.lenses[static_cast<std::size_t>(camera)].focal = 2e-3;
    for (int i = 0; i < 25; ++i) monitor.update_tests(state_, 0, 1.0);
    wrong.push_back({Kind::kFocalLength, camera});
    for (const WrongNumber& one : wrong)
      EXPECT_THAT(monitor.found_wrong(state_),
                  testing::Contains(testing::FieldsAre(one.kind, one.camera)))
          << camera;
  }
}

TEST_F(CalibrationMonitorTest, AssumedErrorsAreNotOpened) {
  CalibrationMonitor assuming = begin_again({.doubts = false, .assumes = true});
  for (const int column : {size_, kFocal}) variance(column) /= 2;
  state_.sizes.common = state_.lenses[0].focal = 1.0;
  for (int i = 0; i < 25; ++i) EXPECT_FALSE(assuming.update_tests(state_, 0, 1.0));
  EXPECT_THAT(state_.parameter_tests, Each(is_closed()));
}

TEST_F(CalibrationMonitorTest, ALensIsOpenOnlyWithAConfiguredSigmaOrToBeRefined) {
  const CalibrationMonitor tested = begin_again({});
  EXPECT_LT(sigma(kFocal), 1e-3);
  EXPECT_FALSE(tested.lens(state_, 0).is_estimated());
  const CalibrationMonitor untested = begin_again({.doubts = false});
  EXPECT_FALSE(untested.are_confirmed(state_, 0));
  for (const int column : {size_, kReadout, kFocal}) EXPECT_EQ(variance(column), 0) << column;
  begin_again({.doubts = false, .refines = true});
  EXPECT_GT(sigma(kFocal), 0.01);
  EXPECT_GT(sigma(layout::centre(0)), 5);
  EXPECT_GT(sigma(layout::distortion(0)), 0.05);
  configure_lens(0.1, 15, 0.2);
  const CalibrationMonitor monitor = begin_again({.doubts = false});
  EXPECT_NEAR(sigma(kFocal), 0.1, 1e-12);
  EXPECT_NEAR(sigma(layout::centre(0)), 15, 1e-9);
  EXPECT_NEAR(sigma(layout::centre(0) + 1), 15, 1e-9);
  EXPECT_NEAR(sigma(layout::distortion(0)), 0.2, 1e-12);
  for (const int column : {size_, kReadout}) EXPECT_EQ(sigma(column), 0) << "is not doubted";
  EXPECT_NEAR(monitor.lens(state_, 0).k1_sigma, 0.2, 1e-12);
  EXPECT_TRUE(monitor.lens(state_, 0).is_estimated());
}

TEST_F(CalibrationMonitorTest, ARefinedLensIsNotClosedAndReportedOnceItIsKnown) {
  CalibrationMonitor monitor = begin_again({.refines = true});
  EXPECT_THAT(found(monitor), IsEmpty());
  // Known well, and as configured: another parameter would be closed.
  for (const int column : {kFocal, layout::centre(0), layout::centre(0) + 1})
    state_.clear_column(column, 3e-4);
  for (int i = 0; i < 300; ++i) monitor.update_tests(state_, 0, 1.0);
  EXPECT_NEAR(sigma(kFocal), 3e-4, 1e-12);
  EXPECT_TRUE(monitor.lens(state_, 0).is_estimated());
  const auto mismatches = found(monitor);
  ASSERT_THAT(mismatches, ElementsAre(Field(&FoundMismatch::kind, Kind::kLens)));
  EXPECT_NEAR(mismatches[0].lens.focal_sigma, 3e-4, 1e-12);
}

TEST_F(CalibrationMonitorTest, ACalibratedLensIsReportedOnlyOutsideItsSigmas) {
  configure_lens(5e-4, 0.3, 3e-4);
  const CalibrationMonitor monitor = begin_again({});
  state_.lenses[0].focal = 1e-3;  // two sigmas of the calibration
  state_.clear_column(kFocal, 1e-4);
  EXPECT_THAT(found(monitor), IsEmpty());
  state_.lenses[0].focal = 3e-3;
  const auto mismatches = found(monitor);
  ASSERT_THAT(mismatches, ElementsAre(Field(&FoundMismatch::kind, Kind::kLens)));
  EXPECT_NEAR(mismatches[0].lens.offset.focal, 3e-3, 1e-12);
}

TEST_F(CalibrationMonitorTest, ALensIsNotBetterKnownThanItsError) {
  mounts_[0].model.width = 800;
  mounts_[0].model.fu = mounts_[0].model.fv = 400;
  mounts_[0].focal_sigma = 5e-4;
  mounts_[0].lens_error_px = 0.05;
  const CalibrationMonitor monitor = begin_again({.doubts = false});
  state_.clear_column(kFocal, 1e-6);
  EXPECT_NEAR(monitor.lens(state_, 0).focal_sigma, 0.05 / 200, 1e-6);
  EXPECT_EQ(monitor.lens(state_, 0).k1_sigma, 0) << "is not estimated";
}

TEST_F(CalibrationMonitorTest, DistortionAloneIsReportedOnceItIsKnown) {
  mounts_[0].k1_sigma = 0.1;
  const CalibrationMonitor monitor = begin_again({.doubts = false});
  EXPECT_THAT(found(monitor), IsEmpty());
  state_.clear_column(layout::distortion(0), 0.003);
  state_.lenses[0].k1 = -0.05;
  const auto mismatches = found(monitor);
  ASSERT_EQ(mismatches.size(), 1u);
  EXPECT_EQ(mismatches[0].lens.offset.k1, -0.05);
}

TEST_F(CalibrationMonitorTest, TheCovarianceIncludesWhatOpeningAParameterChanges) {
  EXPECT_TRUE(monitor_.unmodelled_covariance(state_).isZero(0));
  variance(layout::kPosition) = 1e-6;
  measure(1.0, 0.02, 1e-3);
  test_parameters(5);
  const double doubt = std::sqrt(monitor_.unmodelled_covariance(state_)(0, 0));
  const double before_m = state_.X_WB.p.x();
  test_parameters();
  const double moved_m = std::abs(state_.X_WB.p.x() - before_m);
  EXPECT_GT(doubt, moved_m) << "it is nearly certain";
  EXPECT_LT(doubt, 1.5 * moved_m);
}

TEST_F(CalibrationMonitorTest, AssumedErrorsAreHeldAndInTheCovariance) {
  constexpr double kDistance_m = 4.0;  // by the size of the prints
  CalibrationMonitor assuming = begin_again({.doubts = false, .assumes = true});
  const double held = variance(size_);
  ASSERT_GT(held, 0);
  ASSERT_LT(held, 1e-10) << "it must not move poses";
  state_.P()(layout::kPosition, size_) = state_.P()(size_, layout::kPosition) = kDistance_m * held;
  const Matrix6d unmodelled = assuming.unmodelled_covariance(state_);
  EXPECT_NEAR(std::sqrt(unmodelled(0, 0)), kDistance_m * 0.003, 1e-5);
  EXPECT_EQ(unmodelled(1, 1), 0);
  assuming.hold_parameters(state_, 5);
  EXPECT_THAT(state_.held_tags(), ElementsAre(size_, layout::clock(0)));
  EXPECT_FALSE(assuming.lens(state_, 0).is_estimated());
  mounts_[0].focal_sigma = 0.05;
  CalibrationMonitor refining = begin_again({.doubts = false, .assumes = true});
  EXPECT_NEAR(variance(kFocal), 0.05 * 0.05, 1e-12);
  refining.hold_parameters(state_, 3);
  EXPECT_THAT(state_.held_tags(), ElementsAre(size_)) << "enough tags correct a lens";
  state_.release_blocks();
  refining.hold_parameters(state_, 2);
  EXPECT_THAT(state_.held_tags(), ElementsAre(size_, layout::clock(0)));
}

TEST_F(CalibrationMonitorTest, OneImageAndALargeDispersionOpenNothing) {
  const FilterState before = state_;
  measure_larger_prints();
  test_parameters(1);
  EXPECT_FALSE(state_.parameter_tests.empty());
  EXPECT_THAT(state_.parameter_tests, Each(is_closed()));
  state_ = before;
  place_ = 0;
  measure(1e-3, 1.2e-5, 1e-6);
  test_parameters(25, 9.0);
  EXPECT_THAT(state_.parameter_tests, Each(is_closed()));
}

TEST_F(CalibrationMonitorTest, WatchesEachNewTagUpToItsLimit) {
  for (int tag = 0; tag < layout::kWatchedPrints + 2; ++tag) monitor_.watch_print(state_, tag);
  for (int tag = 0; tag < layout::kWatchedPrints; ++tag) {
    ASSERT_GE(state_.print_at(tag), 0);
    EXPECT_GT(variance(state_.print_at(tag)), 0);
  }
  EXPECT_EQ(state_.print_at(layout::kWatchedPrints), -1);
  // Known well and consistent: the place is free for another.
  const int column = state_.print_at(2);
  state_.clear_column(column, 2e-4);
  test_parameters(5);
  EXPECT_EQ(state_.print_at(2), -1);
  WorldTag tag;
  tag.tag_id = 99;
  state_.add_tag(tag, Matrix6d::Identity());
  monitor_.watch_print(state_, 99);
  EXPECT_EQ(state_.print_at(99), column);
  state_.remove_tag(0);
  EXPECT_EQ(state_.print_at(99), -1) << "a removed tag frees its size";
  EXPECT_EQ(variance(column), 0);
}

TEST_F(CalibrationMonitorTest, EstimatesTheSizeOfATagThatHasContradicted) {
  monitor_.watch_print(state_, 3);
  monitor_.watch_print(state_, 4, true);
  EXPECT_LT(variance(state_.print_at(3)), 1e-6) << "as configured";
  EXPECT_NEAR(variance(state_.print_at(4)), 0.15 * 0.15, 1e-9);
}

TEST_F(CalibrationMonitorTest, WatchesATagInsteadOfTheOneUnseenTheLongest) {
  state_.time = Instant{} + std::chrono::seconds(60);
  for (int id = 0; id < layout::kWatchedPrints; ++id) {
    WorldTag tag;
    tag.tag_id = id;
    tag.last_seen = state_.time - std::chrono::seconds(id == 3 ? 20 : 10 * (id % 2));
    state_.add_tag(tag, Matrix6d::Identity());
    monitor_.watch_print(state_, id);
  }
  monitor_.watch_print(state_, 90);
  EXPECT_EQ(state_.print_at(3), -1) << "not seen for 20 s";
  EXPECT_GE(state_.print_at(90), 0);
  monitor_.watch_print(state_, 91);
  EXPECT_EQ(state_.print_at(1), -1) << "not seen for 10 s";
  monitor_.watch_print(state_, 92);
  EXPECT_EQ(state_.print_at(92), -1) << "all others are in sight";
}

TEST_F(CalibrationMonitorTest, OpensALensAsAWholeAndTheParameterWithTheHighestScore) {
  const FilterState before = state_;
  // Images have halved the variance of the focal length, and moved it by many sigmas.
  variance(kFocal) /= 2;
  state_.lenses[0].focal = 2e-3;
  test_parameters();
  EXPECT_GT(sigma(layout::centre(0)), 1.0);
  EXPECT_GT(sigma(layout::distortion(0)), 0.05);
  EXPECT_LT(sigma(size_), 1e-3) << "prints are no part of the lens";
  state_ = before;
  variance(size_) /= 2;
  state_.sizes.common = 2.5e-3;
  test_parameters(15);
  variance(kReadout) /= 2;
  state_.clocks[0].readout_s = 2e-3;
  EXPECT_THAT(state_.parameter_tests, Each(is_closed()));
  test_parameters(5);
  EXPECT_GT(sigma(kReadout), 1e-3) << "each of them explains other data";
  EXPECT_GT(sigma(size_), 1e-3);
}

}  // namespace
}  // namespace fiducap::world
