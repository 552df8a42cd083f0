#pragma once

#include <cmath>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "estimation/imu/output_predictor.hpp"

namespace fiducap {

inline constexpr double kGravity = 9.81;
inline constexpr Duration kImuPeriod = std::chrono::milliseconds(5);

inline Instant at_s(double s) { return instant_from_ns(100'000'000'000) + from_seconds(s); }

inline BodySensors with_imu() {
  BodySensors sensors;
  sensors.imu = ImuNoise{};
  return sensors;
}

/// A smooth motion with everything in it: turning about three axes while being pushed about.
struct Motion {
  static Eigen::Vector3d p(double t) {
    return {std::sin(1.3 * t), 0.5 * std::cos(2.1 * t), 0.3 * std::sin(1.7 * t)};
  }
  static Eigen::Vector3d v(double t) {
    return {1.3 * std::cos(1.3 * t), -1.05 * std::sin(2.1 * t), 0.51 * std::cos(1.7 * t)};
  }
  static Eigen::Vector3d a(double t) {
    return {-1.69 * std::sin(1.3 * t), -2.205 * std::cos(2.1 * t), -0.867 * std::sin(1.7 * t)};
  }
  static Eigen::Vector3d turn(double t) {
    return {0.8 * std::sin(1.1 * t), 0.6 * std::sin(1.6 * t + 0.5), 0.9 * t};
  }
  static Eigen::Quaterniond q(double t) { return exp_so3(turn(t)); }
  static Eigen::Vector3d w(double t) {
    const Eigen::Vector3d rate(0.88 * std::cos(1.1 * t), 0.96 * std::cos(1.6 * t + 0.5), 0.9);
    return right_jacobian_so3(turn(t)) * rate;
  }

  static ImuSample imu(double t) {
    return {at_s(t), w(t), q(t).conjugate() * (a(t) + Eigen::Vector3d(0, 0, kGravity))};
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

inline Matrix15d start_covariance(double scale = 1.0) {
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
inline BodyEstimate moved(BodyEstimate e, const Eigen::VectorXd& d) {
  e.X_WB.p += d.segment<3>(estimate_block::kPosition);
  e.X_WB.q = (exp_so3(d.segment<3>(estimate_block::kAttitude)) * e.X_WB.q).normalized();
  e.v_WB += d.segment<3>(estimate_block::kVelocity);
  e.bias_f += d.segment<3>(estimate_block::kBiasF);
  e.bias_w += d.segment<3>(estimate_block::kBiasW);
  return e;
}

/// The error coordinates that lead from b to a.
inline Eigen::VectorXd difference(const BodyEstimate& a, const BodyEstimate& b) {
  Eigen::VectorXd d(15);
  d << a.X_WB.p - b.X_WB.p, log_so3(a.X_WB.q * b.X_WB.q.conjugate()), a.v_WB - b.v_WB,
      a.bias_f - b.bias_f, a.bias_w - b.bias_w;
  return d;
}

inline void feed(OutputPredictor& predictor, double from, double to) {
  for (auto t = at_s(from); t <= at_s(to); t += kImuPeriod) {
    predictor.add_imu(Motion::imu(to_seconds(t - at_s(0))));
  }
}

}  // namespace fiducap
