// Turns of a camera against turns of a gyro, without a simulator: exact motions with noise put on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"
#include "pipeline/agreement/rotation_agreement.hpp"

namespace fiducap {
namespace {

using Kind = AgreementFinding::Kind;
using std::numbers::pi;
using testing::HasSubstr;

constexpr double kExact_rad = 1e-6;
constexpr double kShiftTolerance_s = 0.02;
constexpr double kAxesTolerance_rad = 0.12;

Instant at_s(double t_s) { return instant_from_ns(1'000'000'000) + from_seconds(t_s); }

/// Turns about all three axes that never repeat within the lags.
Eigen::Vector3d rate_at(double t_s) {
  return {0.9 * std::sin(1.7 * t_s) + 0.3 * std::sin(4.1 * t_s), 0.8 * std::cos(1.3 * t_s + 0.4),
          0.7 * std::sin(2.3 * t_s + 1.1)};
}

ImuSample reading(double t_s, const Eigen::Matrix3d& axes = Eigen::Matrix3d::Identity()) {
  return {at_s(t_s), axes * rate_at(t_s), {0, 0, 9.81}};
}

TEST(GyroIntegral, KnowsTheTurnOfAnySpan) {
  GyroIntegral gyro;
  for (int i = 0; i < 800; ++i) gyro.add({at_s(0.005 * i), {0.1, 0.2, -0.3}, {0, 0, 9.81}});
  const auto turn = gyro.turn(at_s(1.2341), at_s(1.7341));
  ASSERT_TRUE(turn);
  EXPECT_LT((*turn - Eigen::Vector3d(0.05, 0.1, -0.15)).norm(), kExact_rad);
  EXPECT_FALSE(gyro.turn(at_s(3.5), at_s(4.1))) << "not yet known";
}

TEST(GyroIntegral, ForgetsWhatLiesBehindAPauseAndWhatIsClipped) {
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

TEST(GyroIntegral, IsBoundedWhateverTheRate) {
  GyroIntegral gyro;
  for (int i = 0; i < 20'000; ++i) gyro.add(reading(0.001 * i));
  EXPECT_FALSE(gyro.turn(at_s(10), at_s(11))) << "older than what is kept";
  EXPECT_TRUE(gyro.turn(at_s(16), at_s(19)));
}

/// Turns over 0.3 s, ten a second, as camera and gyro have them.
class CauseTest : public testing::Test {
 protected:
  std::vector<TurnPair> pairs(int count, double shift_s, const Eigen::Matrix3d& A,
                              const Eigen::Vector3d& axes = Eigen::Vector3d::Ones()) {
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, sigma_rad_);
    const auto turn = [&](double from_s) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int i = 0; i < 60; ++i) sum += 0.005 * rate_at(from_s + 0.005 * i);
      return Eigen::Vector3d(sum.cwiseProduct(axes));
    };
    std::vector<TurnPair> all(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
      const double stamp_s = 2 + 0.1 * i;
      TurnPair& pair = all[static_cast<std::size_t>(i)];
      pair.sigma_rad = sigma_rad_;
      pair.camera = A.transpose() * turn(stamp_s + shift_s) +
                    Eigen::Vector3d(noise(random), noise(random), noise(random));
      for (std::size_t lag = 0; lag < lags::kCount; ++lag)
        pair.gyro[lag] = turn(stamp_s + lags::seconds(lag)).cast<float>();
    }
    return all;
  }
  static constexpr ExpectedShift kTold{0, 0.1, false};
  const Eigen::Matrix3d same_{Eigen::Matrix3d::Identity()};
  double sigma_rad_{0.03};
};

TEST_F(CauseTest, FindsAgreementWithinWhatIsTold) {
  for (const double shift_s : {-0.06, 0.0, 0.035}) {
    const auto found = find_cause(pairs(30, shift_s, same_), kTold);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->kind, Kind::kAgree);
    EXPECT_NEAR(found->shift_s, shift_s, kShiftTolerance_s);
  }
}

TEST_F(CauseTest, SmallErrorsOfTheAxesAreAgreement) {
  const Eigen::Matrix3d A = exp_so3({0.05, -0.06, 0.04}).toRotationMatrix();
  const auto found = find_cause(pairs(30, 0, A), kTold);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, Kind::kAgree);
}

TEST_F(CauseTest, NamesAnotherShift) {
  for (const double shift_s : {-0.5, -0.2, 0.3, 0.7}) {
    const auto found = find_cause(pairs(30, shift_s, same_), kTold);
    ASSERT_TRUE(found) << shift_s;
    EXPECT_EQ(found->kind, Kind::kShifted);
    EXPECT_NEAR(found->shift_s, shift_s, kShiftTolerance_s);
  }
  const auto jumped = find_cause(pairs(30, 0.3, same_), {0, 0.06, true});
  ASSERT_TRUE(jumped);
  EXPECT_EQ(jumped->kind, Kind::kJumped);
}

TEST_F(CauseTest, NamesTurnedAxes) {
  for (const Eigen::Vector3d& turn :
       {Eigen::Vector3d(pi / 2, 0, 0), Eigen::Vector3d(0, 0, pi), Eigen::Vector3d(0.4, 0.4, 0)}) {
    const Eigen::Matrix3d A = exp_so3(turn).toRotationMatrix();
    const auto found = find_cause(pairs(40, 0.02, A), kTold);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->kind, Kind::kAxesTurned);
    EXPECT_LT(log_so3(Eigen::Quaterniond(Eigen::Matrix3d(found->A.transpose() * A))).norm(),
              kAxesTolerance_rad);
  }
}

TEST_F(CauseTest, NamesReflectedAxes) {
  Eigen::Matrix3d swapped;
  swapped << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  const Eigen::Matrix3d sign = Eigen::Vector3d(1, 1, -1).asDiagonal();
  for (const Eigen::Matrix3d& A : {swapped, sign, Eigen::Matrix3d(-same_)}) {
    const auto found = find_cause(pairs(40, 0, A), kTold);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->kind, Kind::kAxesReflected);
    EXPECT_LT((found->A - A).norm(), 3 * kAxesTolerance_rad) << found->A;
  }
}

TEST_F(CauseTest, ATurnAboutOneAxisDoesNotTellARotationFromAReflection) {
  const Eigen::Matrix3d A = exp_so3({pi / 2, 0, 0}).toRotationMatrix();
  const auto found = find_cause(pairs(40, 0, A, {0, 0, 1}), kTold);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, Kind::kAxesApart);
}

TEST_F(CauseTest, NamesBothAxesAndShift) {
  const Eigen::Matrix3d A = exp_so3({0, pi / 2, 0}).toRotationMatrix();
  const auto found = find_cause(pairs(40, -0.4, A), kTold);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, Kind::kAxesTurned);
  EXPECT_NEAR(found->shift_s, -0.4, kShiftTolerance_s);
}

TEST_F(CauseTest, SaysNothingOfWhatNothingExplains) {
  std::mt19937 random(11);
  std::normal_distribution<double> gauss(0, 0.2);
  auto noise = pairs(40, 0, same_);
  for (TurnPair& pair : noise) pair.camera = {gauss(random), gauss(random), gauss(random)};
  EXPECT_FALSE(find_cause(noise, kTold));
  EXPECT_FALSE(find_cause(pairs(40, 0, same_, {0.02, 0.02, 0.02}), kTold)) << "hardly turns";
}

TEST_F(CauseTest, AQuarterOfWrongTurnsChangesNothing) {
  auto some = pairs(40, 0.3, same_);
  for (std::size_t i = 0; i < some.size(); i += 5) some[i].camera = -some[i].camera;
  const auto found = find_cause(some, kTold);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, Kind::kShifted);
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
  [[nodiscard]] static Eigen::Vector3d angles(double t_s) {
    return {0.25 * std::sin(2.1 * t_s), 0.25 * std::sin(2.9 * t_s + 1), 0.4 * std::sin(1.7 * t_s)};
  }
  [[nodiscard]] static Eigen::Quaterniond attitude(double t_s) { return exp_so3(angles(t_s)); }

  TagObservations image(double t_s, double stamp_s) {
    const Pose X_WV{attitude(t_s), {0.05 * std::sin(t_s), 0, 0}};
    TagObservations seen;
    seen.exposed_at = at_s(stamp_s);
    for (int id = 0; id < 2; ++id) {
      const Pose X_WT{exp_so3({pi - 0.6, 0.2, 0}), {0.3 * id - 0.15, 0, 1.2}};
      const Pose X_VT = X_WV.inverse() * X_WT;
      TagObservation tag;
      tag.tag_id = id;
      tag.edge_m = 0.2;
      for (int i = 0; i < 4; ++i) {
        const auto corner = static_cast<std::size_t>(i);
        tag.corners_px[corner] =
            sensors_.cameras[0].model.pinhole(X_VT * tag_corner(i, tag.edge_m)) +
            Eigen::Vector2d(noise_(random_), noise_(random_));
        tag.ideal_from_raw[corner].setIdentity();
      }
      seen.tags.push_back(tag);
    }
    return seen;
  }

  /// @return all reports from one time to another
  std::vector<AgreementReport> run(RotationAgreement& agreement, double from_s, double to_s,
                                   double stamp_error_s = 0) {
    std::vector<AgreementReport> said;
    for (int tick = static_cast<int>(from_s * 200); tick < static_cast<int>(to_s * 200); ++tick) {
      const double t_s = tick * 0.005;
      constexpr double kStep_s = 1e-4;
      const Eigen::Vector3d rate =
          log_so3(attitude(t_s - kStep_s).conjugate() * attitude(t_s + kStep_s)) / (2 * kStep_s);
      agreement.add(ImuSample{at_s(t_s), gyro_axes_ * rate, {0, 0, 9.81}});
      if (tick % 10 == 0) agreement.add(image(t_s, t_s + stamp_error_s));
      while (auto news = agreement.take_report()) said.push_back(*std::move(news));
    }
    return said;
  }

  BodySensors sensors_;
  Eigen::Matrix3d gyro_axes_{Eigen::Matrix3d::Identity()};
  std::mt19937 random_{3};
  std::normal_distribution<double> noise_{0, 0.4};
};

constexpr double kCornerNoise_px = 0.4;

TEST_F(RotationAgreementTest, AgreesAndSaysNothing) {
  RotationAgreement agreement(sensors_, kCornerNoise_px);
  EXPECT_TRUE(run(agreement, 0, 30).empty());
  EXPECT_TRUE(agreement.is_established());
  EXPECT_FALSE(agreement.withholds());
}

TEST_F(RotationAgreementTest, WithoutAnImuThereIsNothingToCompare) {
  sensors_.imu.reset();
  RotationAgreement agreement(sensors_, kCornerNoise_px);
  EXPECT_TRUE(run(agreement, 0, 10).empty());
  EXPECT_FALSE(agreement.is_established());
  EXPECT_FALSE(agreement.withholds());
}

TEST_F(RotationAgreementTest, SaysThatACameraIsTurnedAboutItsOpticalAxis) {
  sensors_.cameras[0].X_BV.q = exp_so3({0, 0, pi / 2});
  RotationAgreement agreement(sensors_, kCornerNoise_px);
  const auto said = run(agreement, 0, 20);
  ASSERT_FALSE(said.empty());
  EXPECT_EQ(said.back().finding.kind, Kind::kAxesTurned);
  EXPECT_THAT(said.back().text, HasSubstr("about its optical axis"));
  EXPECT_THAT(said.back().text, HasSubstr("X_BV"));
  EXPECT_TRUE(agreement.withholds());
  EXPECT_FALSE(agreement.is_established());
}

TEST_F(RotationAgreementTest, SaysWhichAxesOfTheGyroAreSwapped) {
  gyro_axes_ << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  RotationAgreement agreement(sensors_, kCornerNoise_px);
  const auto said = run(agreement, 0, 20);
  ASSERT_FALSE(said.empty());
  EXPECT_EQ(said.back().finding.kind, Kind::kAxesReflected);
  EXPECT_THAT(said.back().text, HasSubstr("(y, x, z)"));
  EXPECT_TRUE(agreement.withholds());
}

TEST_F(RotationAgreementTest, SaysHowLateImagesAreStampedUntilTheFilterKnows) {
  RotationAgreement agreement(sensors_, kCornerNoise_px);
  const auto said = run(agreement, 0, 20, 0.5);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(said[0].finding.kind, Kind::kShifted);
  EXPECT_THAT(said[0].text, HasSubstr("stamped 0.50 s late"));
  EXPECT_TRUE(agreement.withholds());
  agreement.set_used_shift(0, -0.5);
  EXPECT_FALSE(agreement.withholds());
}

TEST_F(RotationAgreementTest, GivesTheJumpOfAClockOnce) {
  RotationAgreement agreement(sensors_, kCornerNoise_px);
  EXPECT_TRUE(run(agreement, 0, 15).empty());
  EXPECT_FALSE(agreement.clock_jump());
  const auto said = run(agreement, 15, 40, 0.2);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(said[0].finding.kind, Kind::kJumped);
  EXPECT_THAT(said[0].text, HasSubstr("jumped by 0.2"));
  ASSERT_TRUE(agreement.clock_jump());
  EXPECT_NEAR(to_seconds(agreement.clock_jump()->change), -0.2, kShiftTolerance_s);
  EXPECT_TRUE(agreement.withholds());
  agreement.set_used_shift(0, -0.2);
  EXPECT_FALSE(agreement.withholds());
}

TEST_F(RotationAgreementTest, TakesAWordBackWhenTheGyroIsMended) {
  gyro_axes_ << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  RotationAgreement agreement(sensors_, kCornerNoise_px);
  ASSERT_FALSE(run(agreement, 0, 20).empty());
  gyro_axes_.setIdentity();
  const auto said = run(agreement, 20, 60);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(said[0].finding.kind, Kind::kAgree);
  EXPECT_FALSE(agreement.withholds());
}

TEST_F(RotationAgreementTest, StampsFromAnywhereDoNoHarm) {
  RotationAgreement agreement(sensors_, kCornerNoise_px);
  for (const std::int64_t ns : {INT64_MAX, INT64_MIN, std::int64_t{0}, INT64_MAX / 3}) {
    agreement.add(ImuSample{instant_from_ns(ns), {0, 0, 0}, {0, 0, 9.81}});
    TagObservations seen = image(0, 0);
    seen.exposed_at = instant_from_ns(ns);
    if (agreement.wants(0, seen.exposed_at)) agreement.add(seen);
  }
  EXPECT_FALSE(agreement.wants(1, at_s(0))) << "no such camera";
  EXPECT_TRUE(run(agreement, 0, 30).empty());
  EXPECT_TRUE(agreement.is_established()) << "recovers";
}

}  // namespace
}  // namespace fiducap
