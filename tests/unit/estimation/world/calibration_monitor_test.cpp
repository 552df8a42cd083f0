// Configured parameters are tested, estimated when the data contradict them, fixed again when they
// do not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "estimation/world/noise_watch.hpp"
#include "world/calibration_monitor_fixture.hpp"

namespace fiducap::world {
namespace {

TEST_F(CalibrationMonitorTest, OpensWhatAnotherFilterFoundWrong) {
  EXPECT_TRUE(monitor_.found_wrong(state_).empty());
  const std::vector<WrongNumber> wrong{{FoundMismatch::Kind::kFocalLength, 0},
                                       {FoundMismatch::Kind::kCentreU, 1}};  // no such camera
  monitor_.open_found(state_, wrong);
  EXPECT_NEAR(monitor_.lens(state_, 0).focal_sigma, 0.05, 1e-12);
  EXPECT_EQ(monitor_.lens(state_, 0).centre_sigma_px, Eigen::Vector2d::Zero());
  const auto found = monitor_.found_wrong(state_);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found.front().kind, FoundMismatch::Kind::kFocalLength);
  EXPECT_EQ(found.front().camera, 0);
}

TEST_F(CalibrationMonitorTest, TagSizesAreNotHandedOn) {
  measure(1e-3, 2e-5, 1e-6);
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  ASSERT_GT(std::abs(state_.sizes.common), 0.01) << "it is open";
  EXPECT_TRUE(monitor_.found_wrong(state_).empty());
}

TEST_F(CalibrationMonitorTest, ASignificantParameterIsOpenedAsIfItHadBeenOpenFromTheBeginning) {
  FilterState from_the_beginning = state_;
  from_the_beginning.clear_column(size_, 0.05);
  std::swap(state_, from_the_beginning);
  measure(1e-3, 2e-5, 1e-6);
  const double size = state_.sizes.common;
  const Eigen::MatrixXd P = state_.P();
  std::swap(state_, from_the_beginning);
  place_ = 0;
  measure(1e-3, 2e-5, 1e-6);
  EXPECT_LT(std::abs(state_.sizes.common), 0.1 * size) << "the prior holds it";
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  EXPECT_NEAR(state_.sizes.common, size, 1e-3 * size);
  // Known to a half of it at best, correlated states likewise: only along its column.
  const Eigen::VectorXd along = P.col(size_) / P(size_, size_);
  const double more = 0.25 * size * size - P(size_, size_);
  const Eigen::MatrixXd expected = P + more * along * along.transpose();
  EXPECT_LT((state_.P() - expected).cwiseAbs().maxCoeff(), 5e-3 * expected.cwiseAbs().maxCoeff());
  std::vector<FoundMismatch> found;
  monitor_.list(state_, found);
  EXPECT_TRUE(found.empty()) << "what comes from now on decides";
  place_ = 0;
  measure(1e-3, 2e-5, 1e-6);
  monitor_.list(state_, found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, FoundMismatch::Kind::kAllPrints);
  EXPECT_NEAR(found[0].value, 0.02, 0.003);
}

TEST_F(CalibrationMonitorTest, IsConfirmedOnceTheDataDetermineEveryParameterOfTheCamera) {
  const auto know = [&](int column, double sigma) {
    double& variance = state_.P()(column, column);
    variance = 1 / (1 / variance + 1 / (sigma * sigma));
  };
  EXPECT_FALSE(monitor_.are_confirmed(state_, 0)) << "nothing was seen";
  know(layout::focal(0), 1e-3);
  know(layout::centre(0), 0.5);
  know(layout::centre(0) + 1, 0.5);
  know(layout::distortion(0), 2e-3);
  know(layout::readout(0), 3e-4);
  EXPECT_FALSE(monitor_.are_confirmed(state_, 0)) << "prints may be of another size";
  know(size_, 5e-4);
  EXPECT_TRUE(monitor_.are_confirmed(state_, 0));
  state_.lenses[0].focal = 1e-5;  // of a prior of 5e-5: 4 sigma where it is known to 1e-3
  EXPECT_FALSE(monitor_.are_confirmed(state_, 0));
}

TEST_F(CalibrationMonitorTest, NothingIsConfirmedWhereNothingIsTested) {
  const CalibrationMonitor believed(mounts_, {.doubts = false});
  CalibrationMonitor(mounts_, {.doubts = false}).begin(state_);
  EXPECT_FALSE(believed.are_confirmed(state_, 0));
}

class LensParameter : public testing::Test {
 protected:
  LensParameter() {
    mounts_.resize(1);
    state_.reset({Pose{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}}});
  }
  double sigma(int column) const { return std::sqrt(state_.P()(column, column)); }
  bool is_open_among(const CalibrationMonitor& monitor) const {
    return monitor.lens(state_, 0).is_estimated();
  }

  std::vector<CameraMount> mounts_;
  FilterState state_;
};

TEST_F(LensParameter, IsOpenFromTheFirstImageWithTheConfiguredSigma) {
  mounts_[0].focal_sigma = 0.1;
  mounts_[0].centre_sigma_px = 15;
  mounts_[0].k1_sigma = 0.2;
  CalibrationMonitor monitor(mounts_, {.doubts = false});
  monitor.begin(state_);
  EXPECT_NEAR(sigma(layout::focal(0)), 0.1, 1e-12);
  EXPECT_NEAR(sigma(layout::centre(0)), 15, 1e-9);
  EXPECT_NEAR(sigma(layout::centre(0) + 1), 15, 1e-9);
  EXPECT_NEAR(sigma(layout::distortion(0)), 0.2, 1e-12);
  EXPECT_NEAR(monitor.lens(state_, 0).k1_sigma, 0.2, 1e-12);
  EXPECT_EQ(sigma(layout::sizes(1)), 0) << "nothing else is doubted";
  EXPECT_EQ(sigma(layout::readout(0)), 0);
  EXPECT_TRUE(is_open_among(monitor));
}

TEST_F(LensParameter, IsOpenForEveryCameraToBeRefined) {
  CalibrationMonitor monitor(mounts_, {.doubts = false, .refines = true});
  monitor.begin(state_);
  EXPECT_GT(sigma(layout::focal(0)), 0.01);
  EXPECT_GT(sigma(layout::centre(0)), 5);
  EXPECT_GT(sigma(layout::distortion(0)), 0.05);
}

TEST_F(LensParameter, IsNeverClosedAndReportedOnceItIsKnown) {
  CalibrationMonitor monitor(mounts_, {.refines = true});
  monitor.begin(state_);
  std::vector<FoundMismatch> found;
  monitor.list(state_, found);
  EXPECT_TRUE(found.empty());
  // Known well, and as configured: a parameter would be closed.
  for (const int column : {layout::focal(0), layout::centre(0), layout::centre(0) + 1})
    state_.clear_column(column, 3e-4);
  for (int i = 0; i < 300; ++i) monitor.update_tests(state_, 0, 1.0);
  EXPECT_NEAR(sigma(layout::focal(0)), 3e-4, 1e-12);
  EXPECT_TRUE(is_open_among(monitor));
  monitor.list(state_, found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, FoundMismatch::Kind::kLens);
  EXPECT_NEAR(found[0].lens.focal_sigma, 3e-4, 1e-12);
}

TEST_F(LensParameter, OfACalibrationIsReportedOnlyOutsideItsSigmas) {
  mounts_[0].focal_sigma = 5e-4;
  mounts_[0].centre_sigma_px = 0.3;
  mounts_[0].k1_sigma = 3e-4;
  CalibrationMonitor monitor(mounts_, {});
  monitor.begin(state_);
  std::vector<FoundMismatch> found;
  state_.lenses[0].focal = 1e-3;  // two sigmas of the calibration
  state_.clear_column(layout::focal(0), 1e-4);
  monitor.list(state_, found);
  EXPECT_TRUE(found.empty());
  state_.lenses[0].focal = 3e-3;
  monitor.list(state_, found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, FoundMismatch::Kind::kLens);
  EXPECT_NEAR(found[0].lens.offset.focal, 3e-3, 1e-12);
}

TEST_F(LensParameter, IsNotBetterKnownThanTheLensError) {
  mounts_[0].model.width = 800;
  mounts_[0].model.fu = mounts_[0].model.fv = 400;
  mounts_[0].focal_sigma = 5e-4;
  mounts_[0].lens_error_px = 0.05;
  CalibrationMonitor monitor(mounts_, {.doubts = false});
  monitor.begin(state_);
  state_.clear_column(layout::focal(0), 1e-6);
  EXPECT_NEAR(monitor.lens(state_, 0).focal_sigma, 0.05 / 200, 1e-6);
  EXPECT_EQ(monitor.lens(state_, 0).k1_sigma, 0) << "is not estimated";
}

TEST_F(LensParameter, OfDistortionAloneIsReportedOnceItIsKnown) {
  mounts_[0].k1_sigma = 0.1;
  CalibrationMonitor monitor(mounts_, {.doubts = false});
  monitor.begin(state_);
  std::vector<FoundMismatch> found;
  monitor.list(state_, found);
  EXPECT_TRUE(found.empty());
  state_.clear_column(layout::distortion(0), 0.003);
  state_.lenses[0].k1 = -0.05;
  monitor.list(state_, found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].lens.offset.k1, -0.05);
}

TEST_F(LensParameter, IsClosedWhereNothingIsConfigured) {
  CalibrationMonitor monitor(mounts_, {});
  monitor.begin(state_);
  EXPECT_LT(sigma(layout::focal(0)), 1e-3);
  EXPECT_FALSE(is_open_among(monitor));
}

TEST_F(CalibrationMonitorTest, WithoutTestsNoParameterIsInTheState) {
  CalibrationMonitor trusting(mounts_, {.doubts = false});
  state_.reset({Pose{}});
  trusting.begin(state_);
  EXPECT_EQ(state_.P()(size_, size_), 0) << "the size of all prints";
  EXPECT_EQ(state_.P()(layout::readout(0), layout::readout(0)), 0);
  EXPECT_EQ(state_.P()(layout::focal(0), layout::focal(0)), 0);
}

TEST_F(CalibrationMonitorTest, ALikelyErrorIsInTheCovarianceAsFarAsOpeningMovesTheBody) {
  EXPECT_EQ(monitor_.unmodelled_covariance(state_), Matrix6d::Zero().eval());
  state_.P()(layout::kPosition, layout::kPosition) = 1e-6;
  measure(1.0, 0.02, 1e-3);
  const double pull = std::sqrt(monitor_.unmodelled_covariance(state_)(0, 0));
  const double before_m = state_.X_WB.p.x();
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  EXPECT_GT(pull, 1e-5);
  EXPECT_NEAR(std::abs(state_.X_WB.p.x() - before_m), pull, 1e-3 * pull);
  EXPECT_EQ(monitor_.unmodelled_covariance(state_), Matrix6d::Zero().eval())
      << "it is corrected now";
}

TEST_F(CalibrationMonitorTest, AssumedErrorsAreHeldAndAreInTheCovariance) {
  constexpr double kDistance_m = 4.0;  // by the size of the prints
  CalibrationMonitor assuming(mounts_, {.doubts = false, .assumes = true});
  state_.reset({Pose{}});
  assuming.begin(state_);
  const double held = state_.P()(size_, size_);
  ASSERT_GT(held, 0);
  ASSERT_LT(held, 1e-10) << "it must not move poses";
  state_.P()(layout::kPosition, size_) = state_.P()(size_, layout::kPosition) = kDistance_m * held;
  const Matrix6d unmodelled_covariance = assuming.unmodelled_covariance(state_);
  EXPECT_NEAR(std::sqrt(unmodelled_covariance(0, 0)), kDistance_m * 0.003, 1e-5);
  EXPECT_EQ(unmodelled_covariance(1, 1), 0);
  assuming.hold_parameters(state_, 5);
  EXPECT_THAT(state_.held_tags(), testing::ElementsAre(size_, layout::clock(0)));
  EXPECT_FALSE(assuming.lens(state_, 0).is_estimated());
}

TEST_F(CalibrationMonitorTest, OnlyAnImageWithEnoughTagsCorrectsALensWithConfiguredSigma) {
  mounts_[0].focal_sigma = 0.05;
  CalibrationMonitor assuming(mounts_, {.doubts = false, .assumes = true});
  state_.reset({Pose{}});
  assuming.begin(state_);
  EXPECT_NEAR(state_.P()(layout::focal(0), layout::focal(0)), 0.05 * 0.05, 1e-12);
  assuming.hold_parameters(state_, 3);
  EXPECT_THAT(state_.held_tags(), testing::ElementsAre(size_));
  state_.release_blocks();
  assuming.hold_parameters(state_, 2);
  EXPECT_THAT(state_.held_tags(), testing::ElementsAre(size_, layout::clock(0)));
}

TEST_F(CalibrationMonitorTest, OneImageOpensNothing) {
  measure(1e-3, 2e-5, 1e-6);
  monitor_.update_tests(state_, 0, 1.0);
  EXPECT_FALSE(state_.parameter_tests.empty());
  for (const ParameterTest& test : state_.parameter_tests) EXPECT_FALSE(test.is_open);
}

TEST_F(CalibrationMonitorTest, LargeDispersionOpensNothing) {
  measure(1e-3, 1.2e-5, 1e-6);
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 9.0);
  for (const ParameterTest& test : state_.parameter_tests) EXPECT_FALSE(test.is_open);
}

TEST_F(CalibrationMonitorTest, ClosesAParameterThatIsAsConfigured) {
  measure(1e-3, 2e-5, 1e-6);
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  ASSERT_GT(std::sqrt(state_.P()(size_, size_)), 5e-4);
  for (int i = 0; i < 2000; ++i) measure(1.0, 0.0, 1e-3);
  for (int i = 0; i < 200; ++i) monitor_.update_tests(state_, 0, 1.0);
  for (const ParameterTest& test : state_.parameter_tests) EXPECT_FALSE(test.is_open);
  EXPECT_LT(std::sqrt(state_.P()(size_, size_)), 4e-4) << "the tight prior holds again";
}

TEST_F(CalibrationMonitorTest, WatchesATagFromTheMomentItJoinsWhileThereIsRoom) {
  for (int tag = 0; tag < layout::kWatchedPrints + 2; ++tag) monitor_.watch_print(state_, tag);
  for (int tag = 0; tag < layout::kWatchedPrints; ++tag) {
    const int column = state_.print_at(tag);
    ASSERT_GE(column, 0);
    EXPECT_GT(state_.P()(column, column), 0);
  }
  EXPECT_EQ(state_.print_at(layout::kWatchedPrints), -1);
  // Known well and consistent: the place is free for another.
  const int column = state_.print_at(2);
  state_.clear_column(column, 2e-4);
  monitor_.update_tests(state_, 0, 1.0);
  EXPECT_EQ(state_.print_at(2), -1);
  monitor_.watch_print(state_, 99);
  EXPECT_EQ(state_.print_at(99), column);
}

TEST_F(CalibrationMonitorTest, WatchesANewTagInsteadOfTheOneUnseenForLongest) {
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

TEST_F(CalibrationMonitorTest, OpensALensAsAWhole) {
  auto P = state_.P();
  // Images have halved the variance of the focal length, and moved it by many sigmas.
  P(layout::focal(0), layout::focal(0)) /= 2;
  state_.lenses[0].focal = 2e-3;
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  EXPECT_GT(std::sqrt(P(layout::centre(0), layout::centre(0))), 1.0);
  EXPECT_GT(std::sqrt(P(layout::distortion(0), layout::distortion(0))), 0.05);
  EXPECT_LT(std::sqrt(P(size_, size_)), 1e-3) << "prints are no part of the lens";
}

TEST_F(CalibrationMonitorTest, OpensTheParameterWithTheHighestScore) {
  auto P = state_.P();
  P(size_, size_) /= 2;
  state_.sizes.common = 2.5e-3;
  for (int i = 0; i < kLongEnough - 10; ++i) monitor_.update_tests(state_, 0, 1.0);
  P(layout::readout(0), layout::readout(0)) /= 2;
  state_.clocks[0].readout_s = 2e-3;
  for (int i = 0; i < 10; ++i) monitor_.update_tests(state_, 0, 1.0);
  for (const ParameterTest& test : state_.parameter_tests) EXPECT_FALSE(test.is_open);
  for (int i = 0; i < 10; ++i) monitor_.update_tests(state_, 0, 1.0);
  EXPECT_GT(std::sqrt(P(layout::readout(0), layout::readout(0))), 1e-3);
  EXPECT_LT(std::sqrt(P(size_, size_)), 1e-3);
}

TEST_F(CalibrationMonitorTest, AClosedParameterKeepsItsPriorWhenAnotherIsOpened) {
  auto P = state_.P();
  const double tight = P(layout::focal(0), layout::focal(0));
  measure(1e-3, 2e-5, 1e-6, 1e-3);
  for (int i = 0; i < kLongEnough; ++i) monitor_.update_tests(state_, 0, 1.0);
  ASSERT_GT(std::sqrt(P(size_, size_)), 5e-3);
  EXPECT_LE(P(layout::focal(0), layout::focal(0)), tight * (1 + 1e-9));
}

TEST_F(CalibrationMonitorTest, ARemovedTagFreesItsSize) {
  WorldTag tag;
  tag.tag_id = 7;
  state_.add_tag(tag, Matrix6d::Identity());
  monitor_.watch_print(state_, 7);
  const int column = state_.print_at(7);
  state_.remove_tag(0);
  EXPECT_EQ(state_.print_at(7), -1);
  EXPECT_EQ(state_.P()(column, column), 0);
}

}  // namespace
}  // namespace fiducap::world
