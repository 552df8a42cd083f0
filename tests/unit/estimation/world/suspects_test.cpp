// What the configuration says is doubted, opened when the data contradict it, closed when they do
// not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "estimation/world/teaching_image.hpp"
#include "world/suspects_fixture.hpp"

namespace fiducap::world {
namespace {

TEST_F(SuspectsTest, WhatAnotherFilterFoundWrongIsOpenFromTheFirst) {
  EXPECT_TRUE(suspects_.found_wrong(state_).empty());
  const std::vector<WrongNumber> wrong{{FoundMismatch::Kind::kFocalLength, 0},
                                       {FoundMismatch::Kind::kCentreU, 1}};  // no such camera
  suspects_.begin_open(state_, wrong);
  EXPECT_NEAR(suspects_.lens(state_, 0).focal_sigma, 0.05, 1e-12);
  EXPECT_EQ(suspects_.lens(state_, 0).centre_sigma_px, Eigen::Vector2d::Zero());
  const auto found = suspects_.found_wrong(state_);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found.front().kind, FoundMismatch::Kind::kFocalLength);
  EXPECT_EQ(found.front().camera, 0);
}

TEST_F(SuspectsTest, TheSizeOfPrintsIsNotHandedOn) {
  measure(1e-3, 2e-5, 1e-6);
  for (int i = 0; i < kLongEnough; ++i) suspects_.look(state_, 0, 1.0);
  ASSERT_GT(std::abs(state_.sizes.common), 0.01) << "it is open";
  EXPECT_TRUE(suspects_.found_wrong(state_).empty());
}

TEST_F(SuspectsTest, OneThatIsSurelyWrongIsOpenedAsIfItHadBeenFromTheBeginningButForItsSigma) {
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
  for (int i = 0; i < kLongEnough; ++i) suspects_.look(state_, 0, 1.0);
  EXPECT_NEAR(state_.sizes.common, size, 1e-3 * size);
  // Known to a half of it at best, and what hangs on it likewise: along its column alone.
  const Eigen::VectorXd along = P.col(size_) / P(size_, size_);
  const double more = 0.25 * size * size - P(size_, size_);
  const Eigen::MatrixXd expected = P + more * along * along.transpose();
  EXPECT_LT((state_.P() - expected).cwiseAbs().maxCoeff(), 5e-3 * expected.cwiseAbs().maxCoeff());
  std::vector<FoundMismatch> found;
  suspects_.list(state_, found);
  EXPECT_TRUE(found.empty()) << "what comes from now on decides";
  place_ = 0;
  measure(1e-3, 2e-5, 1e-6);
  suspects_.list(state_, found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, FoundMismatch::Kind::kAllPrints);
  EXPECT_NEAR(found[0].value, 0.02, 0.003);
}

TEST_F(SuspectsTest, AreClearedOnceTheDataKnowEveryNumberOfTheCameraAsConfigured) {
  const auto know = [&](int column, double sigma) {
    double& variance = state_.P()(column, column);
    variance = 1 / (1 / variance + 1 / (sigma * sigma));
  };
  EXPECT_FALSE(suspects_.are_cleared(state_, 0)) << "nothing was seen";
  know(layout::focal(0), 1e-3);
  know(layout::centre(0), 0.5);
  know(layout::centre(0) + 1, 0.5);
  know(layout::distortion(0), 2e-3);
  know(layout::readout(0), 3e-4);
  EXPECT_FALSE(suspects_.are_cleared(state_, 0)) << "prints may be of another size";
  know(size_, 5e-4);
  EXPECT_TRUE(suspects_.are_cleared(state_, 0));
  state_.lenses[0].focal = 1e-5;  // of a prior of 5e-5: 4 sigma where it is known to 1e-3
  EXPECT_FALSE(suspects_.are_cleared(state_, 0));
}

TEST_F(SuspectsTest, NobodyIsClearedWhereNothingIsDoubted) {
  const Suspects believed(mounts_, {.doubts = false});
  Suspects(mounts_, {.doubts = false}).begin(state_);
  EXPECT_FALSE(believed.are_cleared(state_, 0));
}

class LensParameter : public testing::Test {
 protected:
  LensParameter() {
    mounts_.resize(1);
    state_.reset({Pose{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}}});
  }
  double sigma(int column) const { return std::sqrt(state_.P()(column, column)); }
  bool is_open_among(const Suspects& suspects) const {
    return suspects.lens(state_, 0).is_estimated();
  }

  std::vector<CameraMount> mounts_;
  FilterState state_;
};

TEST_F(LensParameter, StandsOpenFromTheFirstImageWithTheSigmaThatIsTold) {
  mounts_[0].focal_sigma = 0.1;
  mounts_[0].centre_sigma_px = 15;
  mounts_[0].k1_sigma = 0.2;
  Suspects suspects(mounts_, {.doubts = false});
  suspects.begin(state_);
  EXPECT_NEAR(sigma(layout::focal(0)), 0.1, 1e-12);
  EXPECT_NEAR(sigma(layout::centre(0)), 15, 1e-9);
  EXPECT_NEAR(sigma(layout::centre(0) + 1), 15, 1e-9);
  EXPECT_NEAR(sigma(layout::distortion(0)), 0.2, 1e-12);
  EXPECT_NEAR(suspects.lens(state_, 0).k1_sigma, 0.2, 1e-12);
  EXPECT_EQ(sigma(layout::sizes(1)), 0) << "nothing else is doubted";
  EXPECT_EQ(sigma(layout::readout(0)), 0);
  EXPECT_TRUE(is_open_among(suspects));
}

TEST_F(LensParameter, StandsOpenOfEveryCameraThatShallBeRefined) {
  Suspects suspects(mounts_, {.doubts = false, .refines = true});
  suspects.begin(state_);
  EXPECT_GT(sigma(layout::focal(0)), 0.01);
  EXPECT_GT(sigma(layout::centre(0)), 5);
  EXPECT_GT(sigma(layout::distortion(0)), 0.05);
}

TEST_F(LensParameter, IsNeverClosedAndToldOnceItIsKnown) {
  Suspects suspects(mounts_, {.refines = true});
  suspects.begin(state_);
  std::vector<FoundMismatch> found;
  suspects.list(state_, found);
  EXPECT_TRUE(found.empty());
  // Known well, and as configured: a suspect would be closed.
  for (const int column : {layout::focal(0), layout::centre(0), layout::centre(0) + 1})
    state_.clear_column(column, 3e-4);
  for (int i = 0; i < 300; ++i) suspects.look(state_, 0, 1.0);
  EXPECT_NEAR(sigma(layout::focal(0)), 3e-4, 1e-12);
  EXPECT_TRUE(is_open_among(suspects));
  suspects.list(state_, found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, FoundMismatch::Kind::kLens);
  EXPECT_NEAR(found[0].lens.focal_sigma, 3e-4, 1e-12);
}

TEST_F(LensParameter, OfACalibrationIsToldOnlyWhenItIsNotAsCalibrated) {
  mounts_[0].focal_sigma = 5e-4;
  mounts_[0].centre_sigma_px = 0.3;
  mounts_[0].k1_sigma = 3e-4;
  Suspects suspects(mounts_, {});
  suspects.begin(state_);
  std::vector<FoundMismatch> found;
  state_.lenses[0].focal = 1e-3;  // two sigmas of the calibration
  state_.clear_column(layout::focal(0), 1e-4);
  suspects.list(state_, found);
  EXPECT_TRUE(found.empty());
  state_.lenses[0].focal = 3e-3;
  suspects.list(state_, found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, FoundMismatch::Kind::kLens);
  EXPECT_NEAR(found[0].lens.offset.focal, 3e-3, 1e-12);
}

TEST_F(LensParameter, IsNotKnownBetterThanWhatTheLensLeaves) {
  mounts_[0].model.width = 800;
  mounts_[0].model.fu = mounts_[0].model.fv = 400;
  mounts_[0].focal_sigma = 5e-4;
  mounts_[0].lens_error_px = 0.05;
  Suspects suspects(mounts_, {.doubts = false});
  suspects.begin(state_);
  state_.clear_column(layout::focal(0), 1e-6);
  EXPECT_NEAR(suspects.lens(state_, 0).focal_sigma, 0.05 / 200, 1e-6);
  EXPECT_EQ(suspects.lens(state_, 0).k1_sigma, 0) << "is not estimated";
}

TEST_F(LensParameter, OfDistortionAloneIsToldOnceThatIsKnown) {
  mounts_[0].k1_sigma = 0.1;
  Suspects suspects(mounts_, {.doubts = false});
  suspects.begin(state_);
  std::vector<FoundMismatch> found;
  suspects.list(state_, found);
  EXPECT_TRUE(found.empty());
  state_.clear_column(layout::distortion(0), 0.003);
  state_.lenses[0].k1 = -0.05;
  suspects.list(state_, found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].lens.offset.k1, -0.05);
}

TEST_F(LensParameter, IsClosedWhereNothingIsToldOrWanted) {
  Suspects suspects(mounts_, {});
  suspects.begin(state_);
  EXPECT_LT(sigma(layout::focal(0)), 1e-3);
  EXPECT_FALSE(is_open_among(suspects));
}

TEST_F(SuspectsTest, WhereNothingIsDoubtedNothingStandsInTheState) {
  Suspects trusting(mounts_, {.doubts = false});
  state_.reset({Pose{}});
  trusting.begin(state_);
  EXPECT_EQ(state_.P()(size_, size_), 0) << "the size of all prints";
  EXPECT_EQ(state_.P()(layout::readout(0), layout::readout(0)), 0);
  EXPECT_EQ(state_.P()(layout::focal(0), layout::focal(0)), 0);
}

TEST_F(SuspectsTest, TheSuspectedPullsTheBodyAsFarAsOpeningItWill) {
  EXPECT_EQ(suspects_.unstated(state_), Matrix6d::Zero().eval());
  state_.P()(layout::kPosition, layout::kPosition) = 1e-6;
  measure(1.0, 0.02, 1e-3);
  const double pull = std::sqrt(suspects_.unstated(state_)(0, 0));
  const double before_m = state_.X_WB.p.x();
  for (int i = 0; i < kLongEnough; ++i) suspects_.look(state_, 0, 1.0);
  EXPECT_GT(pull, 1e-5);
  EXPECT_NEAR(std::abs(state_.X_WB.p.x() - before_m), pull, 1e-3 * pull);
  EXPECT_EQ(suspects_.unstated(state_), Matrix6d::Zero().eval()) << "it is corrected now";
}

TEST_F(SuspectsTest, WhatIsAssumedIsHeldAndMakesTheBodyAsUnsureAsItWouldMakeIt) {
  constexpr double kDistance_m = 4.0;  // by the size of the prints
  Suspects assuming(mounts_, {.doubts = false, .assumes = true});
  state_.reset({Pose{}});
  assuming.begin(state_);
  const double held = state_.P()(size_, size_);
  ASSERT_GT(held, 0);
  ASSERT_LT(held, 1e-10) << "it must not move poses";
  state_.P()(layout::kPosition, size_) = state_.P()(size_, layout::kPosition) = kDistance_m * held;
  const Matrix6d unstated = assuming.unstated(state_);
  EXPECT_NEAR(std::sqrt(unstated(0, 0)), kDistance_m * 0.003, 1e-5);
  EXPECT_EQ(unstated(1, 1), 0);
  hold_sensors(state_, assuming, 5);
  EXPECT_THAT(state_.held_tags(), testing::ElementsAre(size_, layout::clock(0)));
  EXPECT_FALSE(assuming.lens(state_, 0).is_estimated());
}

TEST_F(SuspectsTest, ATellingImageCorrectsALensWhoseSigmaIsToldAndNoOtherDoes) {
  mounts_[0].focal_sigma = 0.05;
  Suspects assuming(mounts_, {.doubts = false, .assumes = true});
  state_.reset({Pose{}});
  assuming.begin(state_);
  EXPECT_NEAR(state_.P()(layout::focal(0), layout::focal(0)), 0.05 * 0.05, 1e-12);
  hold_sensors(state_, assuming, 3);
  EXPECT_THAT(state_.held_tags(), testing::ElementsAre(size_));
  state_.release_blocks();
  hold_sensors(state_, assuming, 2);
  EXPECT_THAT(state_.held_tags(), testing::ElementsAre(size_, layout::clock(0)));
}

TEST_F(SuspectsTest, OneImageAccusesNobody) {
  measure(1e-3, 2e-5, 1e-6);
  suspects_.look(state_, 0, 1.0);
  EXPECT_FALSE(state_.suspicions.empty());
  for (const Suspicion& suspicion : state_.suspicions) EXPECT_FALSE(suspicion.is_open);
}

TEST_F(SuspectsTest, WhatScattersMoreThanItShouldAccusesNobody) {
  measure(1e-3, 1.2e-5, 1e-6);
  for (int i = 0; i < kLongEnough; ++i) suspects_.look(state_, 0, 9.0);
  for (const Suspicion& suspicion : state_.suspicions) EXPECT_FALSE(suspicion.is_open);
}

TEST_F(SuspectsTest, OneThatIsAsConfiguredAfterAllIsClosedAgain) {
  measure(1e-3, 2e-5, 1e-6);
  for (int i = 0; i < kLongEnough; ++i) suspects_.look(state_, 0, 1.0);
  ASSERT_GT(std::sqrt(state_.P()(size_, size_)), 5e-4);
  for (int i = 0; i < 2000; ++i) measure(1.0, 0.0, 1e-3);
  for (int i = 0; i < 200; ++i) suspects_.look(state_, 0, 1.0);
  for (const Suspicion& suspicion : state_.suspicions) EXPECT_FALSE(suspicion.is_open);
  EXPECT_LT(std::sqrt(state_.P()(size_, size_)), 4e-4) << "the tight prior holds again";
}

TEST_F(SuspectsTest, WatchesATagFromTheMomentItJoinsWhileThereIsRoom) {
  for (int tag = 0; tag < layout::kWatchedPrints + 2; ++tag) suspects_.watch_print(state_, tag);
  for (int tag = 0; tag < layout::kWatchedPrints; ++tag) {
    const int column = state_.print_at(tag);
    ASSERT_GE(column, 0);
    EXPECT_GT(state_.P()(column, column), 0);
  }
  EXPECT_EQ(state_.print_at(layout::kWatchedPrints), -1);
  // Known well and not accused: the place is free for another.
  const int column = state_.print_at(2);
  state_.clear_column(column, 2e-4);
  suspects_.look(state_, 0, 1.0);
  EXPECT_EQ(state_.print_at(2), -1);
  suspects_.watch_print(state_, 99);
  EXPECT_EQ(state_.print_at(99), column);
}

TEST_F(SuspectsTest, WatchesANewTagInsteadOfOneThatIsOutOfSightForLongest) {
  state_.time = Instant{} + std::chrono::seconds(60);
  for (int id = 0; id < layout::kWatchedPrints; ++id) {
    WorldTag tag;
    tag.tag_id = id;
    tag.last_seen = state_.time - std::chrono::seconds(id == 3 ? 20 : 10 * (id % 2));
    state_.add_tag(tag, Matrix6d::Identity());
    suspects_.watch_print(state_, id);
  }
  suspects_.watch_print(state_, 90);
  EXPECT_EQ(state_.print_at(3), -1) << "not seen for 20 s";
  EXPECT_GE(state_.print_at(90), 0);
  suspects_.watch_print(state_, 91);
  EXPECT_EQ(state_.print_at(1), -1) << "not seen for 10 s";
  suspects_.watch_print(state_, 92);
  EXPECT_EQ(state_.print_at(92), -1) << "all others are in sight";
}

TEST_F(SuspectsTest, OpensALensAsAWhole) {
  auto P = state_.P();
  // Images have halved the variance of the focal length, and moved it by many sigmas.
  P(layout::focal(0), layout::focal(0)) /= 2;
  state_.lenses[0].focal = 2e-3;
  for (int i = 0; i < kLongEnough; ++i) suspects_.look(state_, 0, 1.0);
  EXPECT_GT(std::sqrt(P(layout::centre(0), layout::centre(0))), 1.0);
  EXPECT_GT(std::sqrt(P(layout::distortion(0), layout::distortion(0))), 0.05);
  EXPECT_LT(std::sqrt(P(size_, size_)), 1e-3) << "prints are no part of the lens";
}

TEST_F(SuspectsTest, DoesNotOpenTheFirstToBeSuspiciousWhenAnotherIsMoreSo) {
  auto P = state_.P();
  P(size_, size_) /= 2;
  state_.sizes.common = 2.5e-3;
  for (int i = 0; i < kLongEnough - 10; ++i) suspects_.look(state_, 0, 1.0);
  P(layout::readout(0), layout::readout(0)) /= 2;
  state_.clocks[0].readout_s = 2e-3;
  for (int i = 0; i < 10; ++i) suspects_.look(state_, 0, 1.0);
  for (const Suspicion& suspicion : state_.suspicions) EXPECT_FALSE(suspicion.is_open);
  for (int i = 0; i < 10; ++i) suspects_.look(state_, 0, 1.0);
  EXPECT_GT(std::sqrt(P(layout::readout(0), layout::readout(0))), 1e-3);
  EXPECT_LT(std::sqrt(P(size_, size_)), 1e-3);
}

TEST_F(SuspectsTest, WhatIsClosedKeepsItsPriorWhenAnotherIsOpened) {
  auto P = state_.P();
  const double tight = P(layout::focal(0), layout::focal(0));
  measure(1e-3, 2e-5, 1e-6, 1e-3);
  for (int i = 0; i < kLongEnough; ++i) suspects_.look(state_, 0, 1.0);
  ASSERT_GT(std::sqrt(P(size_, size_)), 5e-3);
  EXPECT_LE(P(layout::focal(0), layout::focal(0)), tight * (1 + 1e-9));
}

TEST_F(SuspectsTest, ATagThatLeavesTakesItsPrintAlong) {
  WorldTag tag;
  tag.tag_id = 7;
  state_.add_tag(tag, Matrix6d::Identity());
  suspects_.watch_print(state_, 7);
  const int column = state_.print_at(7);
  state_.remove_tag(0);
  EXPECT_EQ(state_.print_at(7), -1);
  EXPECT_EQ(state_.P()(column, column), 0);
}

}  // namespace
}  // namespace fiducap::world
