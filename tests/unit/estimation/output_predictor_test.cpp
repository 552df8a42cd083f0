#include "estimation/imu/output_predictor.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "support/jacobian_check.hpp"
#include "unit/estimation/known_motion.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

class OutputPredictorTest : public testing::Test {
 protected:
  BodyEstimate predict(double t) { return *predictor_.predict(at_s(t)); }
  double error_m(double t) { return (predict(t).X_WB.p - Motion::p(t)).norm(); }

  OutputPredictor predictor_{with_imu(), {}};
};

TEST_F(OutputPredictorTest, GivesNothingBeforeTheFirstEstimateAndAfterClear) {
  feed(predictor_, 0, 0.1);
  EXPECT_FALSE(predictor_.predict(at_s(0.1)));
  predictor_.set_estimate(Motion::truth(0.05));
  EXPECT_TRUE(predictor_.predict(at_s(0.1)));
  predictor_.clear();
  EXPECT_FALSE(predictor_.predict(at_s(0.1)));
}

TEST_F(OutputPredictorTest, BodyAtRestDoesNotMove) {
  BodyEstimate rest;
  rest.at = at_s(0);
  rest.X_WB = {exp_so3({0.3, -0.2, 1.0}), {1, 2, 3}};
  predictor_.set_estimate(rest);
  for (int i = 0; i <= 200; ++i) {
    predictor_.add_imu({at_s(0) + i * kImuPeriod, Vector3d::Zero(),
                        rest.X_WB.q.conjugate() * Vector3d(0, 0, kGravity)});
  }
  const auto now = predict(1.003);
  constexpr double kRounding = 1e-12;  // nothing may accumulate in 200 steps
  EXPECT_LT(difference(now, rest).norm(), kRounding);
  EXPECT_LT(now.a_WB.norm(), kRounding);
  EXPECT_EQ(now.at, at_s(1.003));
}

TEST_F(OutputPredictorTest, FollowsAFastMotionOverOneSecondOfImu) {
  feed(predictor_, 0, 0.2);
  predictor_.set_estimate(Motion::truth(0.1234));  // between two samples
  feed(predictor_, 0.205, 1.1);
  const auto now = predict(1.1034);
  const auto truth = Motion::truth(1.1034);
  constexpr double kMidPoint_m = 1e-4;  // second-order rule at 200 Hz; Euler is 100 times worse
  constexpr double kMidPoint_rad = 5e-5;
  constexpr double kHeld_m_s2 = 0.08;  // force and rate are 3.4 ms old
  constexpr double kHeld_rad_s = 0.01;
  EXPECT_LT((now.X_WB.p - truth.X_WB.p).norm(), kMidPoint_m);
  EXPECT_LT(angle_between(now.X_WB.q, truth.X_WB.q), kMidPoint_rad);
  EXPECT_LT((now.v_WB - truth.v_WB).norm(), 3e-4);
  EXPECT_LT((now.w_WB_B - truth.w_WB_B).norm(), kHeld_rad_s);
  EXPECT_LT((now.a_WB - truth.a_WB).norm(), kHeld_m_s2);
  EXPECT_TRUE(now.anchored);
}

TEST_F(OutputPredictorTest, AppliesNewerSamplesAgainToALateEstimate) {
  auto estimate = Motion::truth(0.42);
  estimate.covariance = start_covariance();
  OutputPredictor samples_first(with_imu(), {});
  feed(samples_first, 0, 0.6);
  samples_first.set_estimate(Motion::truth(0.1));
  samples_first.set_estimate(estimate);
  OutputPredictor estimate_first(with_imu(), {});
  feed(estimate_first, 0, 0.42);
  estimate_first.set_estimate(estimate);
  feed(estimate_first, 0.425, 0.6);
  const auto a = samples_first.predict(at_s(0.603));
  const auto b = estimate_first.predict(at_s(0.603));
  EXPECT_LT(difference(*a, *b).norm(), 1e-12);  // rounding only
  EXPECT_LT((a->covariance - b->covariance).norm(), 1e-12);
}

TEST_F(OutputPredictorTest, PredictsBetweenTheEstimateAndTheNewestSample) {
  feed(predictor_, 0, 0.6);
  predictor_.set_estimate(Motion::truth(0.4));
  for (const double t : {0.4, 0.4011, 0.5, 0.5949, 0.5951, 0.5999, 0.6}) {
    const auto then = predict(t);
    EXPECT_LT(difference(then, Motion::truth(t)).norm(), 1e-4) << t;  // mid-point rule
    EXPECT_LT((then.w_WB_B - Motion::w(t)).norm(), 1e-3) << t;
    EXPECT_EQ(then.at, at_s(t));
  }
}

TEST_F(OutputPredictorTest, MovesTheEstimateBackByItsVelocityAndRate) {
  predictor_.set_estimate(Motion::truth(0.4));
  const auto before = predictor_.predict(at_s(0.38));
  const auto truth = Motion::truth(0.38);
  constexpr double kStraightLine_m = 0.5 * 3.0 * 0.02 * 0.02;  // half a t², a below 3 m/s²
  EXPECT_LT((before->X_WB.p - truth.X_WB.p).norm(), kStraightLine_m);
  EXPECT_LT(angle_between(before->X_WB.q, truth.X_WB.q), 1e-3);
  EXPECT_EQ(before->at, at_s(0.38));
}

TEST_F(OutputPredictorTest, IgnoresLateRepeatedAndNonFiniteSamples) {
  OutputPredictor clean(with_imu(), {});
  OutputPredictor dirty(with_imu(), {});
  clean.set_estimate(Motion::truth(0));
  dirty.set_estimate(Motion::truth(0));
  for (int i = 0; i < 20; ++i) {
    const auto imu = Motion::imu(0.005 * i);
    clean.add_imu(imu);
    dirty.add_imu(imu);
    auto wrong = imu;
    wrong.w_WB_B.setConstant(50);
    dirty.add_imu(wrong);  // same time stamp
    wrong.sampled_at -= std::chrono::milliseconds(7);
    dirty.add_imu(wrong);
    wrong.sampled_at = imu.sampled_at + std::chrono::milliseconds(1);
    wrong.f_B.x() = std::numeric_limits<double>::quiet_NaN();
    dirty.add_imu(wrong);
  }
  EXPECT_EQ(difference(*clean.predict(at_s(0.1)), *dirty.predict(at_s(0.1))).norm(), 0);
}

TEST_F(OutputPredictorTest, ToleratesAStampFarInTheFuture) {
  predictor_.set_estimate(Motion::truth(0));
  feed(predictor_, 0, 0.1);
  auto stray = Motion::imu(0.105);
  stray.sampled_at += std::chrono::hours(24);
  predictor_.add_imu(stray);
  feed(predictor_, 0.105, 0.2);
  predictor_.set_estimate(Motion::truth(0.15));
  EXPECT_LT(difference(*predictor_.predict(at_s(0.2)), Motion::truth(0.2)).norm(), 1e-4);
}

TEST_F(OutputPredictorTest, CoastsLongerThanItsMemory) {
  predictor_.set_estimate(Motion::truth(0));
  feed(predictor_, 0, 4);
  constexpr double kMidPoint_m = 2e-3;  // 4 s of the second-order rule, grows with t²
  EXPECT_LT(error_m(4), kMidPoint_m);
  EXPECT_LT(error_m(3.5), kMidPoint_m);
}

TEST_F(OutputPredictorTest, BridgesAGapOfSamplesWithMotionNoise) {
  predictor_.set_estimate(Motion::truth(0));
  feed(predictor_, 0, 0.1);
  feed(predictor_, 0.4, 0.5);
  const auto after = predictor_.predict(at_s(0.5));
  const double sigma = std::sqrt(after->covariance(0, 0));
  const double expected = 3.0 * std::sqrt(0.3 * 0.3 * 0.3 / 3.0 + 0.3 * 0.1 * (0.3 + 0.1));
  EXPECT_NEAR(sigma, expected, 0.05 * expected);  // tilt adds a few percent
  EXPECT_LT((after->X_WB.p - Motion::p(0.5)).norm(), 3 * std::sqrt(3) * sigma);
  EXPECT_LT((after->w_WB_B - Motion::w(0.5)).norm(), 1e-9);
}

TEST_F(OutputPredictorTest, HoldsTheLastSampleAndThenTheVelocity) {
  feed(predictor_, 0, 0.2);
  predictor_.set_estimate(Motion::truth(0.2));
  EXPECT_LT(error_m(0.25), 2e-3);
  EXPECT_GT(predict(0.25).a_WB.norm(), 0.5);
  const auto coasted = predict(1.2);
  EXPECT_EQ(coasted.a_WB.norm(), 0);
  EXPECT_GT(coasted.covariance(0, 0), 1.0);  // 3 m/s²/√Hz over 0.9 s: 1.5 m
}

struct Transition {
  const char* name;
  bool imu;
  double start, last_sample, to;
};

class OutputPredictorTransition : public testing::TestWithParam<Transition> {};

TEST_P(OutputPredictorTransition, CovarianceFollowsTheMean) {
  const auto& c = GetParam();
  BodySensors sensors;
  if (c.imu) sensors.imu = ImuNoise{0, 0, 0, 0, 200};
  EstimatorConfig config;
  config.motion_accel_m_s2_rtHz = 0;
  config.motion_angular_rad_s2_rtHz = 0;
  auto start = Motion::truth(c.start);
  start.bias_f = {0.1, -0.2, 0.05};
  start.bias_w = c.imu ? Vector3d(0.01, 0.02, -0.03) : Vector3d(-Motion::w(c.start));
  if (c.imu) start.w_WB_B -= start.bias_w;
  const auto carried = [&](const BodyEstimate& e) {
    OutputPredictor predictor(sensors, config);
    feed(predictor, 0, c.last_sample);
    predictor.set_estimate(e);
    return *predictor.predict(at_s(c.to));
  };
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const Matrix15d A = Matrix15d::NullaryExpr([&] { return normal(random); });
  start.covariance = A * A.transpose();
  const auto end = carried(start);
  const Eigen::MatrixXd F = central_differences(
      [&](const VectorXd& d) {
        auto e = moved(start, d);
        // The measured rate is fixed; what the bias explains of it is not.
        e.w_WB_B = c.imu ? Vector3d(start.w_WB_B - d.segment<3>(estimate_block::kBiasW))
                         : Vector3d(-e.bias_w);
        return difference(carried(e), end);
      },
      15);
  const Eigen::MatrixXd expected = propagated(F, start.covariance);
  EXPECT_LT((end.covariance - expected).norm(), 1e-6 * expected.norm())
      << "analytic:\n"
      << end.covariance << "\nnumeric:\n"
      << expected;
  EXPECT_LT((end.covariance - end.covariance.transpose()).norm(), 1e-12 * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(Cases, OutputPredictorTransition,
                         testing::Values(Transition{"OneSample", true, 0.2, 0.205, 0.205},
                                         Transition{"ManySamples", true, 0.2, 0.5, 0.5},
                                         Transition{"BetweenSamples", true, 0.2021, 0.5, 0.4037},
                                         Transition{"Held", true, 0.2, 0.2, 0.29},
                                         Transition{"HeldThenCoasting", true, 0.2, 0.2, 0.5},
                                         Transition{"MovedBack", true, 0.2, 0.2, 0.17},
                                         Transition{"WithoutImu", false, 0.2, 0, 0.45},
                                         Transition{"WithoutImuMovedBack", false, 0.2, 0, 0.17}),
                         [](const auto& given) { return std::string(given.param.name); });

struct Noise {
  Vector3d vector(double sigma) {
    return Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  }
  /// An error with the covariance of the estimate.
  VectorXd error(const BodyEstimate& e) {
    return VectorXd(e.covariance.diagonal().cwiseSqrt().unaryExpr(
        [&](double sigma) { return normal(random) * sigma; }));
  }
  std::mt19937 random;
  std::normal_distribution<double> normal{};
};

constexpr int kRuns = 400;

/// Sum of the normalised estimation errors squared of `kRuns` runs, of 15 numbers each.
void expect_consistent(double nees) {
  // 4 sigma of the mean of a chi-square with 15 degrees of freedom, for a fixed seed.
  EXPECT_NEAR(nees / kRuns, 15.0, 4.0 * std::sqrt(2.0 * 15.0 / kRuns));
}

TEST(OutputPredictor, CovarianceMatchesTheScatterOfNoisyImuRuns) {
  Noise noise{std::mt19937(11)};
  auto sensors = with_imu();
  sensors.imu = ImuNoise{5e-3, 1e-2, 5e-2, 5e-2, 200};  // walks large enough to be seen in 0.7 s
  const ImuNoise& n = *sensors.imu;
  const double root_rate = std::sqrt(n.rate_hz);
  double nees = 0;
  for (int run = 0; run < kRuns; ++run) {
    OutputPredictor predictor(sensors, {});
    auto start = Motion::truth(0);
    start.covariance = start_covariance();
    predictor.set_estimate(moved(start, noise.error(start)));
    Vector3d bias_f = Vector3d::Zero();
    Vector3d bias_w = Vector3d::Zero();
    for (int i = 0; i <= 140; ++i) {
      auto imu = Motion::imu(0.005 * i);
      imu.w_WB_B += bias_w + noise.vector(n.gyro_noise_rad_s_rtHz * root_rate);
      imu.f_B += bias_f + noise.vector(n.accel_noise_m_s2_rtHz * root_rate);
      predictor.add_imu(imu);
      bias_w += noise.vector(n.gyro_walk_rad_s2_rtHz / root_rate);
      bias_f += noise.vector(n.accel_walk_m_s3_rtHz / root_rate);
    }
    auto truth = Motion::truth(0.7);
    truth.bias_f = bias_f;
    truth.bias_w = bias_w;
    const auto end = *predictor.predict(at_s(0.7));
    nees += squared_distance(difference(truth, end), end.covariance);
  }
  expect_consistent(nees);
}

TEST(OutputPredictor, CovarianceMatchesTheScatterOfMotionNoiseWithoutImu) {
  Noise noise{std::mt19937(13)};
  EstimatorConfig config;
  config.motion_accel_m_s2_rtHz = 2.0;
  config.motion_angular_rad_s2_rtHz = 1.5;
  constexpr int kSteps = 400;
  constexpr double kDt = 0.2 / kSteps;
  double nees = 0;
  for (int run = 0; run < kRuns; ++run) {
    OutputPredictor predictor(BodySensors{}, config);
    auto start = Motion::truth(0);
    start.bias_w = -start.w_WB_B;
    start.covariance = start_covariance();
    auto truth = moved(start, noise.error(start));
    predictor.set_estimate(start);
    for (int i = 0; i < kSteps; ++i) {
      truth.X_WB.p += kDt * truth.v_WB;
      truth.X_WB.q = (truth.X_WB.q * exp_so3(-kDt * truth.bias_w)).normalized();
      truth.v_WB += noise.vector(config.motion_accel_m_s2_rtHz * std::sqrt(kDt));
      truth.bias_w += noise.vector(config.motion_angular_rad_s2_rtHz * std::sqrt(kDt));
    }
    const auto end = *predictor.predict(at_s(0.2));
    nees += squared_distance(difference(truth, end), end.covariance);
    EXPECT_EQ((end.w_WB_B + end.bias_w).norm(), 0);
  }
  expect_consistent(nees);
}

}  // namespace
}  // namespace fiducap
