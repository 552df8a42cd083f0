// What is decided when the rotations of a camera and of a gyro disagree.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <random>

#include "base/pose.hpp"
#include "pipeline/rotation_agreement.hpp"
#include "support/results.hpp"
#include "unit/estimation/example_tags.hpp"

namespace fiducap {
namespace {

using Kind = AgreementFinding::Kind;
using std::numbers::pi;
using testing::HasSubstr;

constexpr double kShiftSigma_s = 0.02;  ///< At most.

Instant at_s(double t_s) { return instant_from_ns(1'000'000'000) + from_seconds(t_s); }

/// A camera with an IMU that turns in front of tags, with the calibration of both.
class RotationAgreementTest : public testing::Test {
 protected:
  RotationAgreementTest() {
    CameraMount mount;
    mount.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    sensors_.cameras = {mount};
    sensors_.imu = ImuNoise{};
  }

  /// Turns little about where it starts, so that the tags stay in view.
  [[nodiscard]] static Eigen::Quaterniond attitude(double t_s) {
    return exp_so3(
        {0.25 * std::sin(2.1 * t_s), 0.25 * std::sin(2.9 * t_s + 1), 0.4 * std::sin(1.7 * t_s)});
  }

  TagObservations image(double t_s, Instant stamp) {
    const Pose X_WV{attitude(t_s), {0.05 * std::sin(t_s), 0, 0}};
    TagObservations seen;
    seen.exposed_at = stamp;
    for (int id = 0; id < 2; ++id) {
      const Pose X_WT{exp_so3({pi - 0.6, 0.2, 0}), {0.3 * id - 0.15, 0, 1.2}};
      seen.tags.push_back(noisy_observation(id, 0.2, X_WV.inverse() * X_WT,
                                            sensors_.cameras[0].model, kCornerNoise_px, random_));
    }
    return seen;
  }

  /// Starts again with the present sensors.
  void begin() { agreement_.emplace(sensors_, kCornerNoise_px); }
  /// @return all reports from one time to another
  std::vector<AgreementReport> run(double from_s, double to_s, double stamp_error_s = 0) {
    if (!agreement_) begin();
    std::vector<AgreementReport> reports;
    for (int tick = static_cast<int>(from_s * 200); tick < static_cast<int>(to_s * 200); ++tick) {
      const double t_s = tick * 0.005;
      constexpr double kStep_s = 1e-4;
      const Eigen::Vector3d rate =
          log_so3(attitude(t_s - kStep_s).conjugate() * attitude(t_s + kStep_s)) / (2 * kStep_s);
      agreement_->add(ImuSample{at_s(t_s), unit_ * gyro_axes_ * rate, {0, 0, 9.81}});
      if (tick % 10 == 0) agreement_->add(image(t_s, at_s(t_s + stamp_error_s)), fits_);
      while (auto report = agreement_->take_report()) reports.push_back(*std::move(report));
    }
    return reports;
  }
  /// The last report of a run names this cause with these words, and poses are withheld.
  void expect_fault(const std::vector<AgreementReport>& reports, Kind kind,
                    const std::vector<std::string>& words) {
    ASSERT_FALSE(reports.empty());
    EXPECT_EQ(reports.back().finding.kind, kind);
    for (const std::string& word : words) EXPECT_THAT(reports.back().text, HasSubstr(word));
    EXPECT_TRUE(agreement_->withholds());
  }

  static constexpr double kCornerNoise_px = 0.4;
  BodySensors sensors_;
  Eigen::Matrix3d gyro_axes_{Eigen::Matrix3d::Identity()};
  double unit_{1};
  bool fits_{false};  ///< The filter explains the images.
  std::optional<RotationAgreement> agreement_;
  std::mt19937 random_{3};
};

TEST_F(RotationAgreementTest, ComparesNothingWithoutAnImu) {
  sensors_.imu.reset();
  EXPECT_TRUE(run(0, 10).empty());
  EXPECT_FALSE(agreement_->is_established());
  EXPECT_FALSE(agreement_->withholds());
}

TEST_F(RotationAgreementTest, ReportsSwappedAxesOfTheGyroUntilTheyAreRepaired) {
  gyro_axes_ << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  expect_fault(run(0, 20), Kind::kAxesReflected, {"(y, x, z)"});
  gyro_axes_.setIdentity();
  const auto reports = run(20, 60);
  ASSERT_EQ(reports.size(), 1u);
  EXPECT_EQ(reports[0].finding.kind, Kind::kAgree);
  EXPECT_FALSE(agreement_->withholds());
}

TEST_F(RotationAgreementTest, ReportsLateStampsUntilTheFilterUsesTheShift) {
  const auto reports = run(0, 20, 0.5);
  EXPECT_EQ(reports.size(), 1u);
  expect_fault(reports, Kind::kShifted, {" s late against the IMU"});
  EXPECT_NEAR(reports.back().finding.fit.shift_s, -0.5,
              4 * reports.back().finding.fit.shift_sigma_s);
  agreement_->set_used_shift(0, -0.5);
  EXPECT_FALSE(agreement_->withholds());
}

TEST_F(RotationAgreementTest, ReportsAClockJumpOnce) {
  EXPECT_TRUE(run(0, 15).empty());
  EXPECT_FALSE(agreement_->clock_jump());
  const auto reports = run(15, 40, 0.2);
  EXPECT_EQ(reports.size(), 1u);
  expect_fault(reports, Kind::kJumped, {"jumped by"});
  EXPECT_LT(reports.back().finding.fit.shift_sigma_s, kShiftSigma_s);
  ASSERT_TRUE(agreement_->clock_jump());
  EXPECT_NEAR(to_seconds(agreement_->clock_jump()->change), -0.2,
              4 * reports.back().finding.fit.shift_sigma_s);
  agreement_->set_used_shift(0, -0.2);
  EXPECT_FALSE(agreement_->withholds());
}

TEST_F(RotationAgreementTest, KeepsImagesThatFitAndComparesThemWhenOthersDoNot) {
  EXPECT_TRUE(run(0, 15).empty());
  fits_ = true;
  EXPECT_TRUE(run(15, 30, 0.2).empty());
  fits_ = false;
  // The images kept are enough for a decision; its confirmation needs three more turns.
  expect_fault(run(30, 31, 0.2), Kind::kJumped, {"jumped by"});
}

TEST_F(RotationAgreementTest, ComparesUntilAReportedShiftIsOver) {
  EXPECT_TRUE(run(0, 15).empty());
  EXPECT_EQ(run(15, 25, 0.2).size(), 1u);
  agreement_->set_used_shift(0, -0.2);
  fits_ = true;
  EXPECT_TRUE(run(25, 45, 0.2).empty());
  // The clock has drifted far since, and the filter has followed.
  agreement_->set_used_shift(0, -0.5);
  EXPECT_FALSE(agreement_->withholds());
}

TEST_F(RotationAgreementTest, NamesTurnedAxesWithALargeOffset) {
  gyro_axes_ = exp_so3({0, pi / 2, 0}).toRotationMatrix();
  expect_fault(run(0, 25, 0.4), Kind::kAxesTurned, {"looks along other axes"});
}

TEST_F(RotationAgreementTest, FindsAGyroInDegreesUntilItIsRepaired) {
  unit_ = 180 / pi;
  EXPECT_TRUE(run(0, 15).empty());
  EXPECT_TRUE(agreement_->has_degrees());
  unit_ = 1;
  EXPECT_TRUE(run(15, 40).empty());
  EXPECT_FALSE(agreement_->has_degrees());
}

TEST_F(RotationAgreementTest, ToleratesAnyStamps) {
  begin();
  for (const std::int64_t ns : {INT64_MAX, INT64_MIN, std::int64_t{0}, INT64_MAX / 3}) {
    const Instant at = instant_from_ns(ns);
    agreement_->add(ImuSample{at, {0, 0, 0}, {0, 0, 9.81}});
    agreement_->add(image(0, at));
  }
  EXPECT_TRUE(run(0, 30).empty());
  EXPECT_TRUE(agreement_->is_established());
}

}  // namespace
}  // namespace fiducap
