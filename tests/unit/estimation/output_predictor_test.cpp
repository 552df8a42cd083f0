#include "estimation/output_predictor.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include <Eigen/Cholesky>

#include "base/so3.hpp"
#include "support/allocation_counter.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kGravity = 9.81;
constexpr Duration kImuPeriod = std::chrono::milliseconds(5);

Instant at_s(double s) { return instant_from_ns(100'000'000'000) + from_seconds(s); }

BodySensors with_imu() {
  BodySensors sensors;
  sensors.imu = ImuNoise{};
  return sensors;
}

/// A smooth motion with everything in it: turning about three axes while being pushed about.
struct Motion {
  static Vector3d p(double t) {
    return {std::sin(1.3 * t), 0.5 * std::cos(2.1 * t), 0.3 * std::sin(1.7 * t)};
  }
  static Vector3d v(double t) {
    return {1.3 * std::cos(1.3 * t), -1.05 * std::sin(2.1 * t), 0.51 * std::cos(1.7 * t)};
  }
  static Vector3d a(double t) {
    return {-1.69 * std::sin(1.3 * t), -2.205 * std::cos(2.1 * t), -0.867 * std::sin(1.7 * t)};
  }
  static Vector3d turn(double t) {
    return {0.8 * std::sin(1.1 * t), 0.6 * std::sin(1.6 * t + 0.5), 0.9 * t};
  }
  static Eigen::Quaterniond q(double t) { return exp_so3(turn(t)); }
  static Vector3d w(double t) {
    const Vector3d rate(0.88 * std::cos(1.1 * t), 0.96 * std::cos(1.6 * t + 0.5), 0.9);
    return right_jacobian_so3(turn(t)) * rate;
  }

  static ImuSample imu(double t) {
    return {at_s(t), w(t), q(t).conjugate() * (a(t) + Vector3d(0, 0, kGravity))};
  }
  static BodyEstimate truth(double t) {
    BodyEstimate e;
    e.at = at_s(t);
    e.X_WB = {q(t), p(t)};
    e.v_WB = v(t);
    e.w_WB_B = w(t);
    e.a_WB = a(t);
    e.anchored = true;
    return e;
  }
};

Matrix15d start_covariance(double scale = 1.0) {
  Matrix15d P = Matrix15d::Zero();
  const auto set = [&P](int block, double sigma) {
    P.diagonal().segment<3>(block).array() = sigma * sigma;
  };
  set(estimate_block::kPosition, 0.01 * scale);
  set(estimate_block::kAttitude, 0.01 * scale);
  set(estimate_block::kVelocity, 0.02 * scale);
  set(estimate_block::kBiasF, 0.03 * scale);
  set(estimate_block::kBiasW, 0.005 * scale);
  return P;
}

/// State moved by error coordinates, as BodyEstimate::covariance defines them.
BodyEstimate moved(BodyEstimate e, const VectorXd& d) {
  e.X_WB.p += d.segment<3>(estimate_block::kPosition);
  e.X_WB.q = (exp_so3(d.segment<3>(estimate_block::kAttitude)) * e.X_WB.q).normalized();
  e.v_WB += d.segment<3>(estimate_block::kVelocity);
  e.bias_f += d.segment<3>(estimate_block::kBiasF);
  e.bias_w += d.segment<3>(estimate_block::kBiasW);
  return e;
}

/// The error coordinates that lead from b to a.
VectorXd difference(const BodyEstimate& a, const BodyEstimate& b) {
  VectorXd d(15);
  d << a.X_WB.p - b.X_WB.p, log_so3(a.X_WB.q * b.X_WB.q.conjugate()), a.v_WB - b.v_WB,
      a.bias_f - b.bias_f, a.bias_w - b.bias_w;
  return d;
}

void feed(OutputPredictor& predictor, double from, double to) {
  for (auto t = at_s(from); t <= at_s(to); t += kImuPeriod) {
    predictor.add_imu(Motion::imu(to_seconds(t - at_s(0))));
  }
}

TEST(OutputPredictor, SaysNothingBeforeTheFirstEstimateAndAfterClear) {
  OutputPredictor predictor(with_imu(), {});
  feed(predictor, 0, 0.1);
  EXPECT_FALSE(predictor.predict(at_s(0.1)));
  predictor.set_estimate(Motion::truth(0.05));
  EXPECT_TRUE(predictor.predict(at_s(0.1)));
  predictor.clear();
  EXPECT_FALSE(predictor.predict(at_s(0.1)));
}

TEST(OutputPredictor, BodyAtRestStaysWhereItIs) {
  OutputPredictor predictor(with_imu(), {});
  BodyEstimate rest;
  rest.at = at_s(0);
  rest.X_WB = {exp_so3({0.3, -0.2, 1.0}), {1, 2, 3}};
  predictor.set_estimate(rest);
  for (int i = 0; i <= 200; ++i) {
    predictor.add_imu({at_s(0) + i * kImuPeriod, Vector3d::Zero(),
                       rest.X_WB.q.conjugate() * Vector3d(0, 0, kGravity)});
  }
  const auto now = predictor.predict(at_s(1.003));
  ASSERT_TRUE(now);
  constexpr double kRounding = 1e-12;  // nothing may accumulate in 200 steps
  EXPECT_LT(difference(*now, rest).norm(), kRounding);
  EXPECT_LT(now->a_WB.norm(), kRounding);
  EXPECT_EQ(now->at, at_s(1.003));
}

TEST(OutputPredictor, FollowsAFastMotionOverOneSecondOfImu) {
  OutputPredictor predictor(with_imu(), {});
  feed(predictor, 0, 0.2);
  predictor.set_estimate(Motion::truth(0.1234));  // between two samples
  feed(predictor, 0.205, 1.1);
  const auto now = predictor.predict(at_s(1.1034));
  ASSERT_TRUE(now);
  const auto truth = Motion::truth(1.1034);
  constexpr double kMidPoint_m =
      1e-4;  // second-order rule at 200 Hz over 1 s; Euler is 100 times worse
  constexpr double kMidPoint_rad = 5e-5;
  constexpr double kHeld_m_s2 = 0.08;  // force and rate are 3.4 ms old
  constexpr double kHeld_rad_s = 0.01;
  EXPECT_LT((now->X_WB.p - truth.X_WB.p).norm(), kMidPoint_m);
  EXPECT_LT(angle_between(now->X_WB.q, truth.X_WB.q), kMidPoint_rad);
  EXPECT_LT((now->v_WB - truth.v_WB).norm(), 3e-4);
  EXPECT_LT((now->w_WB_B - truth.w_WB_B).norm(), kHeld_rad_s);
  EXPECT_LT((now->a_WB - truth.a_WB).norm(), kHeld_m_s2);
  EXPECT_TRUE(now->anchored);
}

TEST(OutputPredictor, ALateEstimateGetsTheNewerSamplesAppliedAgain) {
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

TEST(OutputPredictor, AnswersForInstantsBetweenEstimateAndNewestSample) {
  OutputPredictor predictor(with_imu(), {});
  feed(predictor, 0, 0.6);
  predictor.set_estimate(Motion::truth(0.4));
  for (const double t : {0.4, 0.4011, 0.5, 0.5949, 0.5951, 0.5999, 0.6}) {
    const auto then = predictor.predict(at_s(t));
    constexpr double kMidPoint = 1e-4;
    EXPECT_LT(difference(*then, Motion::truth(t)).norm(), kMidPoint) << t;
    EXPECT_LT((then->w_WB_B - Motion::w(t)).norm(), 1e-3) << t;
    EXPECT_EQ(then->at, at_s(t));
  }
}

TEST(OutputPredictor, MovesTheEstimateBackByItsVelocityAndRate) {
  OutputPredictor predictor(with_imu(), {});
  predictor.set_estimate(Motion::truth(0.4));
  const auto before = predictor.predict(at_s(0.38));
  const auto truth = Motion::truth(0.38);
  constexpr double kStraightLine_m = 0.5 * 3.0 * 0.02 * 0.02;  // half a t², a below 3 m/s²
  EXPECT_LT((before->X_WB.p - truth.X_WB.p).norm(), kStraightLine_m);
  EXPECT_LT(angle_between(before->X_WB.q, truth.X_WB.q), 1e-3);
  EXPECT_EQ(before->at, at_s(0.38));
}

TEST(OutputPredictor, IgnoresLateRepeatedAndNonFiniteSamples) {
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

TEST(OutputPredictor, StartsAgainWhenTheTimeLineOfTheDeviceStartsAgain) {
  OutputPredictor predictor(with_imu(), {});
  predictor.set_estimate(Motion::truth(0));
  feed(predictor, 0, 0.1);
  auto stray = Motion::imu(0.105);
  stray.sampled_at += std::chrono::hours(24);
  predictor.add_imu(stray);
  feed(predictor, 0.105, 0.2);
  predictor.set_estimate(Motion::truth(0.15));
  EXPECT_LT(difference(*predictor.predict(at_s(0.2)), Motion::truth(0.2)).norm(), 1e-4);
}

TEST(OutputPredictor, CoastsLongerThanItsMemory) {
  OutputPredictor predictor(with_imu(), {});
  predictor.set_estimate(Motion::truth(0));
  feed(predictor, 0, 4);
  constexpr double kMidPoint_m =
      2e-3;  // 4 s of the second-order rule, position error grows with t²
  EXPECT_LT((predictor.predict(at_s(4))->X_WB.p - Motion::p(4)).norm(), kMidPoint_m);
  EXPECT_LT((predictor.predict(at_s(3.5))->X_WB.p - Motion::p(3.5)).norm(), kMidPoint_m);
}

TEST(OutputPredictor, BridgesAHoleInTheStreamWithMotionNoise) {
  OutputPredictor predictor(with_imu(), {});
  predictor.set_estimate(Motion::truth(0));
  feed(predictor, 0, 0.1);
  feed(predictor, 0.4, 0.5);
  const auto after = predictor.predict(at_s(0.5));
  const double sigma = std::sqrt(after->covariance(0, 0));
  const double expected = 3.0 * std::sqrt(0.3 * 0.3 * 0.3 / 3.0 + 0.3 * 0.1 * (0.3 + 0.1));
  EXPECT_NEAR(sigma, expected, 0.05 * expected);  // tilt adds a few percent
  EXPECT_LT((after->X_WB.p - Motion::p(0.5)).norm(), 3 * std::sqrt(3) * sigma);
  EXPECT_LT((after->w_WB_B - Motion::w(0.5)).norm(), 1e-9);
}

TEST(OutputPredictor, HoldsTheLastSampleAndThenTheVelocity) {
  OutputPredictor predictor(with_imu(), {});
  feed(predictor, 0, 0.2);
  predictor.set_estimate(Motion::truth(0.2));
  const auto held = predictor.predict(at_s(0.25));
  EXPECT_LT((held->X_WB.p - Motion::p(0.25)).norm(), 2e-3);
  EXPECT_GT(held->a_WB.norm(), 0.5);
  const auto coasted = predictor.predict(at_s(1.2));
  EXPECT_EQ(coasted->a_WB.norm(), 0);
  EXPECT_GT(coasted->covariance(0, 0), 1.0);  // 3 m/s²/√Hz over 0.9 s: 1.5 m
}

// --- covariance ---

struct Transition {
  const char* name;
  bool imu;
  double start, last_sample, to;
};

class OutputPredictorTransition : public testing::TestWithParam<Transition> {};

TEST_P(OutputPredictorTransition, MovesTheCovarianceWithTheJacobianOfTheMean) {
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
  const Eigen::MatrixXd expected = F * start.covariance * F.transpose();
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

/// Mean of the normalised estimation error squared over many runs; 15 when the covariance is
/// honest.
struct Nees {
  double sum{0};
  int runs{0};
  void add(const VectorXd& error, const Eigen::MatrixXd& P) {
    sum += error.dot(P.ldlt().solve(error));
    ++runs;
  }
  void expect_honest() const {
    // 4 sigma of the mean of a chi-square with 15 degrees of freedom; the seed is fixed, so this is
    // no lottery.
    const double band = 4.0 * std::sqrt(2.0 * 15.0 / runs);
    EXPECT_NEAR(sum / runs, 15.0, band);
  }
};

TEST(OutputPredictor, CovarianceMatchesTheScatterOfNoisyImuRuns) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const auto noise3 = [&](double sigma) {
    return Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  auto sensors = with_imu();
  sensors.imu = ImuNoise{5e-3, 1e-2, 5e-2, 5e-2, 200};  // walks large enough to be seen in 0.7 s
  const ImuNoise& n = *sensors.imu;
  const double root_rate = std::sqrt(n.rate_hz);
  Nees nees;
  for (int run = 0; run < 400; ++run) {
    OutputPredictor predictor(sensors, {});
    auto start = Motion::truth(0);
    start.covariance = start_covariance();
    VectorXd d(15);
    for (int i = 0; i < 15; ++i) d(i) = normal(random) * std::sqrt(start.covariance(i, i));
    predictor.set_estimate(moved(start, d));
    Vector3d bias_f = Vector3d::Zero();
    Vector3d bias_w = Vector3d::Zero();
    for (int i = 0; i <= 140; ++i) {
      auto imu = Motion::imu(0.005 * i);
      imu.w_WB_B += bias_w + noise3(n.gyro_noise_rad_s_rtHz * root_rate);
      imu.f_B += bias_f + noise3(n.accel_noise_m_s2_rtHz * root_rate);
      predictor.add_imu(imu);
      bias_w += noise3(n.gyro_walk_rad_s2_rtHz / root_rate);
      bias_f += noise3(n.accel_walk_m_s3_rtHz / root_rate);
    }
    auto truth = Motion::truth(0.7);
    truth.bias_f = bias_f;
    truth.bias_w = bias_w;
    const auto end = *predictor.predict(at_s(0.7));
    nees.add(difference(truth, end), end.covariance);
  }
  nees.expect_honest();
}

TEST(OutputPredictor, CovarianceMatchesTheScatterOfMotionNoiseWithoutImu) {
  std::mt19937 random(13);
  std::normal_distribution<double> normal;
  const auto noise3 = [&](double sigma) {
    return Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  EstimatorConfig config;
  config.motion_accel_m_s2_rtHz = 2.0;
  config.motion_angular_rad_s2_rtHz = 1.5;
  constexpr int kSteps = 400;
  constexpr double kDt = 0.2 / kSteps;
  Nees nees;
  for (int run = 0; run < 400; ++run) {
    OutputPredictor predictor(BodySensors{}, config);
    auto start = Motion::truth(0);
    start.bias_w = -start.w_WB_B;
    start.covariance = start_covariance();
    VectorXd d(15);
    for (int i = 0; i < 15; ++i) d(i) = normal(random) * std::sqrt(start.covariance(i, i));
    auto truth = moved(start, d);
    predictor.set_estimate(start);
    for (int i = 0; i < kSteps; ++i) {
      truth.X_WB.p += kDt * truth.v_WB;
      truth.X_WB.q = (truth.X_WB.q * exp_so3(-kDt * truth.bias_w)).normalized();
      truth.v_WB += noise3(config.motion_accel_m_s2_rtHz * std::sqrt(kDt));
      truth.bias_w += noise3(config.motion_angular_rad_s2_rtHz * std::sqrt(kDt));
    }
    const auto end = *predictor.predict(at_s(0.2));
    nees.add(difference(truth, end), end.covariance);
    EXPECT_EQ((end.w_WB_B + end.bias_w).norm(), 0);
  }
  nees.expect_honest();
}

TEST(OutputPredictor, AllocatesNothingAfterConstruction) {
  OutputPredictor predictor(with_imu(), {});
  const AllocationCounter allocations;
  double sum = 0;
  for (int i = 0; i < 600; ++i) {
    predictor.add_imu(Motion::imu(0.005 * i));
    if (i % 10 == 9) predictor.set_estimate(Motion::truth(0.005 * i - 0.03));
    if (const auto now = predictor.predict(at_s(0.005 * i + 0.002))) sum += now->X_WB.p.x();
    if (const auto then = predictor.predict(at_s(0.005 * i - 0.02))) sum += then->X_WB.p.x();
  }
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_NE(sum, 0);
}

}  // namespace
}  // namespace fiducap
