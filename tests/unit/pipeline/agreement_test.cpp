// Rotations of a camera against those of a gyro: exact motions with noise added.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <random>

#include "base/pose.hpp"
#include "pipeline/agreement/rotation_agreement.hpp"
#include "support/results.hpp"
#include "unit/estimation/example_tags.hpp"

namespace fiducap {
namespace {

using Kind = AgreementFinding::Kind;
using std::numbers::pi;
using testing::HasSubstr;

constexpr double kExact_rad = 1e-6;
constexpr double kShiftSigma_s = 0.02;  ///< At most.
constexpr double kAxesTolerance_rad = 0.12;

Instant at_s(double t_s) { return instant_from_ns(1'000'000'000) + from_seconds(t_s); }

/// Rotates about all three axes and does not repeat within the lags.
Eigen::Vector3d rate_at(double t_s) {
  return {0.9 * std::sin(1.7 * t_s) + 0.3 * std::sin(4.1 * t_s), 0.8 * std::cos(1.3 * t_s + 0.4),
          0.7 * std::sin(2.3 * t_s + 1.1)};
}

ImuSample reading(double t_s, const Eigen::Matrix3d& axes = Eigen::Matrix3d::Identity()) {
  return {at_s(t_s), axes * rate_at(t_s), {0, 0, 9.81}};
}

TEST(GyroIntegral, GivesTheRotationOfAnySpan) {
  GyroIntegral gyro;
  for (int i = 0; i < 800; ++i) gyro.add({at_s(0.005 * i), {0.1, 0.2, -0.3}, {0, 0, 9.81}});
  const auto turn = value_of(gyro.turn(at_s(1.2341), at_s(1.7341)));
  EXPECT_LT((turn - Eigen::Vector3d(0.05, 0.1, -0.15)).norm(), kExact_rad);
  EXPECT_FALSE(gyro.turn(at_s(3.5), at_s(4.1))) << "not yet known";
}

TEST(GyroIntegral, GivesNothingAcrossAPauseOrASaturation) {
  GyroIntegral gyro(4.0);
  const auto run = [&](double from_s, double to_s) {
    for (double t_s = from_s; t_s < to_s; t_s += 0.005) gyro.add(reading(t_s));
  };
  run(0, 1);
  run(1.2, 2);
  EXPECT_FALSE(gyro.turn(at_s(0.9), at_s(1.5)));
  EXPECT_TRUE(gyro.turn(at_s(1.3), at_s(1.5)));
  gyro.add({at_s(2), {0, 4.0, 0}, {0, 0, 9.81}});
  run(2.005, 2.5);
  EXPECT_FALSE(gyro.turn(at_s(1.9), at_s(2.2)));
  EXPECT_TRUE(gyro.turn(at_s(2.1), at_s(2.2)));
}

TEST(GyroIntegral, IsBoundedAtAnyRate) {
  GyroIntegral gyro;
  for (int i = 0; i < 20'000; ++i) gyro.add(reading(0.001 * i));
  EXPECT_FALSE(gyro.turn(at_s(10), at_s(11))) << "older than what is kept";
  EXPECT_TRUE(gyro.turn(at_s(16), at_s(19)));
}

/// Rotations over 0.3 s, ten a second, as camera and gyro have them.
class CauseTest : public testing::Test {
 protected:
  std::vector<TurnPair> pairs(int count, double shift_s, const Eigen::Matrix3d& A,
                              const Eigen::Vector3d& axes = Eigen::Vector3d::Ones()) {
    constexpr double kSigma_rad = 0.03;
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, kSigma_rad);
    const auto turn = [&](double from_s) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int i = 0; i < 60; ++i) sum += 0.005 * rate_at(from_s + 0.005 * i);
      return Eigen::Vector3d(sum.cwiseProduct(axes));
    };
    std::vector<TurnPair> all(static_cast<std::size_t>(count));
    double stamp_s = 2;
    for (TurnPair& pair : all) {
      pair.sigma_rad = kSigma_rad;
      pair.camera = A.transpose() * turn(stamp_s + shift_s) +
                    Eigen::Vector3d(noise(random), noise(random), noise(random));
      for (std::size_t lag = 0; lag < lags::kCount; ++lag)
        pair.gyro[lag] = turn(stamp_s + lags::seconds(lag)).cast<float>();
      stamp_s += 0.1;
    }
    return all;
  }
  /// A finding with this shift.
  static void expect_finding(const std::vector<TurnPair>& pairs, Kind kind, double shift_s,
                             const ExpectedShift& configured = kConfigured) {
    SCOPED_TRACE(shift_s);
    const auto found = value_of(find_cause(pairs, configured));
    EXPECT_EQ(found.kind, kind);
    EXPECT_LT(found.shift_sigma_s, kShiftSigma_s);
    EXPECT_NEAR(found.shift_s, shift_s, 4 * found.shift_sigma_s);
  }
  static constexpr ExpectedShift kConfigured{0, 0.1, false};
  const Eigen::Matrix3d same_{Eigen::Matrix3d::Identity()};
};

TEST_F(CauseTest, FindsAgreementWithinTheConfiguredShift) {
  for (const double shift_s : {-0.06, 0.0, 0.035})
    expect_finding(pairs(30, shift_s, same_), Kind::kAgree, shift_s);
}

TEST_F(CauseTest, SmallErrorsOfTheAxesAreAgreement) {
  const Eigen::Matrix3d A = exp_so3({0.05, -0.06, 0.04}).toRotationMatrix();
  const auto found = value_of(find_cause(pairs(30, 0, A), kConfigured));
  EXPECT_EQ(found.kind, Kind::kAgree);
}

TEST_F(CauseTest, NamesAnotherShift) {
  for (const double shift_s : {-0.5, -0.2, 0.3, 0.7})
    expect_finding(pairs(30, shift_s, same_), Kind::kShifted, shift_s);
  expect_finding(pairs(30, 0.3, same_), Kind::kJumped, 0.3, {0, 0.06, true});
}

TEST_F(CauseTest, NamesTurnedAxes) {
  for (const Eigen::Vector3d& turn :
       {Eigen::Vector3d(pi / 2, 0, 0), Eigen::Vector3d(0, 0, pi), Eigen::Vector3d(0.4, 0.4, 0)}) {
    const Eigen::Matrix3d A = exp_so3(turn).toRotationMatrix();
    const auto found = value_of(find_cause(pairs(40, 0.02, A), kConfigured));
    EXPECT_EQ(found.kind, Kind::kAxesTurned);
    EXPECT_LT(log_so3(Eigen::Quaterniond(Eigen::Matrix3d(found.A.transpose() * A))).norm(),
              kAxesTolerance_rad);
  }
}

TEST_F(CauseTest, NamesReflectedAxes) {
  Eigen::Matrix3d swapped;
  swapped << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  const Eigen::Matrix3d sign = Eigen::Vector3d(1, 1, -1).asDiagonal();
  for (const Eigen::Matrix3d& A : {swapped, sign, Eigen::Matrix3d(-same_)}) {
    const auto found = value_of(find_cause(pairs(40, 0, A), kConfigured));
    EXPECT_EQ(found.kind, Kind::kAxesReflected);
    EXPECT_LT((found.A - A).norm(), 3 * kAxesTolerance_rad) << found.A;
  }
}

TEST_F(CauseTest, OneAxisDoesNotDistinguishRotationFromReflection) {
  const Eigen::Matrix3d A = exp_so3({pi / 2, 0, 0}).toRotationMatrix();
  const auto found = value_of(find_cause(pairs(40, 0, A, {0, 0, 1}), kConfigured));
  EXPECT_EQ(found.kind, Kind::kAxesApart);
}

TEST_F(CauseTest, NamesBothAxesAndShift) {
  expect_finding(pairs(40, -0.4, exp_so3({0, pi / 2, 0}).toRotationMatrix()), Kind::kAxesTurned,
                 -0.4);
}

TEST_F(CauseTest, GivesNoCauseForNoiseOrWithoutRotation) {
  std::mt19937 random(11);
  std::normal_distribution<double> gauss(0, 0.2);
  auto noise = pairs(40, 0, same_);
  for (TurnPair& pair : noise) pair.camera = {gauss(random), gauss(random), gauss(random)};
  EXPECT_FALSE(find_cause(noise, kConfigured));
  EXPECT_FALSE(find_cause(pairs(40, 0, same_, {0.02, 0.02, 0.02}), kConfigured)) << "hardly turns";
}

TEST_F(CauseTest, AFifthOfWrongRotationsHasNoInfluence) {
  auto some = pairs(40, 0.3, same_);
  for (std::size_t i = 0; i < some.size(); i += 5) some[i].camera = -some[i].camera;
  const auto found = value_of(find_cause(some, kConfigured));
  EXPECT_EQ(found.kind, Kind::kShifted);
}

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
      agreement_->add(ImuSample{at_s(t_s), gyro_axes_ * rate, {0, 0, 9.81}});
      if (tick % 10 == 0) agreement_->add(image(t_s, at_s(t_s + stamp_error_s)));
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
  EXPECT_NEAR(reports.back().finding.shift_s, -0.5, 4 * reports.back().finding.shift_sigma_s);
  agreement_->set_used_shift(0, -0.5);
  EXPECT_FALSE(agreement_->withholds());
}

TEST_F(RotationAgreementTest, ReportsAClockJumpOnce) {
  EXPECT_TRUE(run(0, 15).empty());
  EXPECT_FALSE(agreement_->clock_jump());
  const auto reports = run(15, 40, 0.2);
  EXPECT_EQ(reports.size(), 1u);
  expect_fault(reports, Kind::kJumped, {"jumped by"});
  EXPECT_LT(reports.back().finding.shift_sigma_s, kShiftSigma_s);
  ASSERT_TRUE(agreement_->clock_jump());
  EXPECT_NEAR(to_seconds(agreement_->clock_jump()->change), -0.2,
              4 * reports.back().finding.shift_sigma_s);
  agreement_->set_used_shift(0, -0.2);
  EXPECT_FALSE(agreement_->withholds());
}

TEST_F(RotationAgreementTest, ToleratesAnyStamps) {
  begin();
  for (const std::int64_t ns : {INT64_MAX, INT64_MIN, std::int64_t{0}, INT64_MAX / 3}) {
    const Instant at = instant_from_ns(ns);
    agreement_->add(ImuSample{at, {0, 0, 0}, {0, 0, 9.81}});
    if (agreement_->wants(0, at)) agreement_->add(image(0, at));
  }
  EXPECT_FALSE(agreement_->wants(1, at_s(0))) << "no such camera";
  EXPECT_TRUE(run(0, 30).empty());
  EXPECT_TRUE(agreement_->is_established());
}

}  // namespace
}  // namespace fiducap
