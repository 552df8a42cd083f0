// The covariance of OutputPredictor is consistent with its mean.
#include <gtest/gtest.h>

#include <random>

#include "estimation/imu/output_predictor.hpp"
#include "support/jacobian_check.hpp"
#include "unit/estimation/known_motion.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

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
