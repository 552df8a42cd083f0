#include "estimation/world/propagation.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/filter/dense_kernels.hpp"
#include "estimation/filter/filter_rules.hpp"

namespace fiducap::world {

using namespace layout;  // NOLINT: block names

namespace {
// Random walk of a clock with temperature: below a millisecond per hour.
constexpr double kShiftWalk_s_rts = 1e-5;
// The temperature of a board settles in ten minutes.
constexpr double kDriftLasts_s = 600.0;
// Error of speed and rate between two odometry poses.
constexpr double kOdometrySpeed_m_s = 0.3;
constexpr double kOdometryRate_rad_s = 0.01;

/// Φ ← F Φ, with the sparsity of F.
void add_step(const BodyMatrix& F, BodyMatrix& Phi) {
  const auto add = [&](int to, int by, int from) {
    Phi.block<3, 3>(to, from) += F.block<3, 3>(to, by).lazyProduct(Phi.block<3, 3>(by, from));
  };
  for (const int from : {kAttitude, kBiasF, kBiasW}) add(kPosition, kVelocity, from);
  add(kPosition, kAttitude, kBiasW);
  add(kVelocity, kAttitude, kBiasW);
  // Direct terms.
  Phi.middleCols<12>(kAttitude).topRows<9>() += F.middleCols<12>(kAttitude).topRows<9>();
  Phi.diagonal().segment<6>(kAttitude).array() -= 1;
}

/// Only the pose continues; speed and rate are those of the odometry.
void propagate_by_odometry(MovingBody& state, MotionSinceImage& motion, const InertialInput& input,
                           double dt) {
  state.v_WB = state.X_WB.q * *input.v_B;
  state.X_WB = state.X_WB * Pose{exp_so3(dt * input.w_B), dt * *input.v_B};
  state.gyro_B = input.w_B;
  state.a_WB.setZero();
  state.bias_f.setZero();
  state.bias_w.setZero();
  motion.Phi.bottomRows<kBodySize - kVelocity>().setZero();
  motion.Q.bottomRows<kBodySize - kVelocity>().setZero();
  motion.Q.rightCols<kBodySize - kVelocity>().setZero();
  motion.Q.diagonal().segment<3>(kVelocity).setConstant(kOdometrySpeed_m_s * kOdometrySpeed_m_s);
  motion.Q.diagonal().tail<6>().setConstant(kOdometryRate_rad_s * kOdometryRate_rad_s);
  // The earlier world-side error does not change; the added one is the body's.
  Matrix6d drift = adjoint(state.X_WB);
  drift.leftCols<3>() *= input.velocity_noise;
  drift.rightCols<3>() *= input.gyro_noise;
  motion.Q.topLeftCorner<6, 6>() += dt * drift * drift.transpose();
}

/// M ← F M + G, with the sparsity of F.
void add_step(const StepJacobians& step, MotionParameterMatrix& M) {
  const auto add = [&](int to, int by) {
    M.middleRows<3>(to) += step.F.block<3, 3>(to, by).lazyProduct(M.middleRows<3>(by));
  };
  add(kPosition, kVelocity);
  add(kPosition, kAttitude);
  add(kVelocity, kAttitude);
  M += step.by_parameters;
}

/// M ← M + C Gᵀ with G = by_parameters. @param C  columns of the parameters
void add_parameters(const MotionSinceImage& motion, dense::ConstView C, Eigen::Ref<BodyColumns> M) {
  for (const int to : {kPosition, kAttitude, kVelocity})
    dense::add_product(C, kMotionSize, {&motion.by_parameters(to, 0), kBiasF},
                       {M.col(to).data(), M.outerStride()}, M.rows(), dense::Width::kThree);
  for (int axis = 0; axis < 3; ++axis) {
    const double* const drift = C.data + C.stride * (gyro_drift(0) - gravity(0) + axis);
    for (Eigen::Index k = 0; k < M.rows(); ++k) M(k, kBiasW + axis) += motion.seconds * drift[k];
  }
}

/// The drift of the gyro is a Gauss-Markov process with its prior as stationary distribution.
void propagate_drift(FilterState& state, double seconds) {
  const double left = std::exp(-seconds / kDriftLasts_s);
  const int at = gyro_drift(state.cameras());
  auto P = state.P();
  P.middleCols<3>(at) *= left;
  P.middleRows<3>(at) *= left;
  P.diagonal().segment<3>(at).array() +=
      (1 - left * left) * state.gyro_drift_sigma * state.gyro_drift_sigma;
  state.imu.gyro_drift *= left;
}
}  // namespace

// In an order in which no column is read after it changed.
void move_columns(const BodyMatrix& F, Eigen::Ref<BodyColumns> M) {
  const auto add = [&](int to, int first, int count) {
    dense::add_product({M.col(first).data(), M.outerStride()}, count, {&F(to, first), kBodySize},
                       {M.col(to).data(), M.outerStride()}, M.rows(), dense::Width::kThree);
  };
  static_assert(kVelocity == kAttitude + 3 && kBiasF == kVelocity + 3 && kBiasW == kBiasF + 3);
  add(kPosition, kAttitude, 12);
  add(kVelocity, kAttitude, 3);
  add(kVelocity, kBiasF, 6);
  add(kAttitude, kBiasW, 3);
}

void move_both_ways(const BodyMatrix& F, BodyMatrix& M) {
  move_columns(F, M);
  M.transposeInPlace();  // M Fᵀ is (F M)ᵀ, for M is symmetric
  move_columns(F, M);
}

namespace {
/// Derivatives by the errors of the IMU, and their effect on those by the biases.
/// @param w_B   corrected rate
/// @param f_B   corrected force
/// @param step  F by the biases of an IMU without other errors
void add_parameter_jacobians(const ImuIntrinsics& imu, const Eigen::Vector3d& w_B,
                             const Eigen::Vector3d& f_B, double dt, StepJacobians& step) {
  const auto accel = (1 + imu.accel_scale.array()).inverse().matrix().eval();
  const Eigen::Matrix3d gyro = (1 + imu.gyro_scale.array()).inverse().matrix().asDiagonal() *
                               exp_so3(-imu.gyro_turn).toRotationMatrix();
  const auto gyro_scaled = w_B.cwiseQuotient((1 + imu.gyro_scale.array()).matrix()).eval();
  const Eigen::Vector3d turned_w = w_B.cwiseProduct((1 + imu.gyro_scale.array()).matrix());
  const Eigen::Vector3d unscale = -(1 + imu.gyro_scale.array()).inverse().matrix();
  const Eigen::Matrix3d by_turn =
      unscale.asDiagonal() * (skew(turned_w) * left_jacobian_so3(-imu.gyro_turn));
  auto& G = step.by_parameters;
  for (const int to : {kPosition, kAttitude, kVelocity}) {
    auto by_bias_f = step.F.block<3, 3>(to, kBiasF);
    auto by_bias_w = step.F.block<3, 3>(to, kBiasW);
    G.block<3, 3>(to, 1) = by_bias_f * f_B.cwiseProduct(accel).asDiagonal();
    G.block<3, 3>(to, 4) = by_bias_w * by_turn;
    G.block<3, 3>(to, 7) = by_bias_w * gyro_scaled.asDiagonal();
    by_bias_f *= accel.asDiagonal();
    by_bias_w *= gyro;
  }
  G(kPosition + 2, 0) = -0.5 * dt * dt;
  G(kVelocity + 2, 0) = -dt;
}
}  // namespace

StepJacobians step_mean(MovingBody& state, const InertialInput& input,
                        const Eigen::Vector3d& gravity_W, double dt) {
  const Eigen::Vector3d w_B = state.imu.rate(input.w_B - state.bias_w);
  const Eigen::Vector3d f_B = input.has_accelerometer ? state.imu.force(input.f_B - state.bias_f)
                                                      : Eigen::Vector3d(Eigen::Vector3d::Zero());
  const Eigen::Vector3d g_W =
      input.has_accelerometer
          ? Eigen::Vector3d(gravity_W - state.gravity_offset_m_s2 * Eigen::Vector3d::UnitZ())
          : Eigen::Vector3d::Zero();
  const Eigen::Quaterniond q_half = state.X_WB.q * exp_so3(0.5 * dt * w_B);
  const Eigen::Matrix3d R_half = q_half.toRotationMatrix();
  const Eigen::Vector3d a_W = R_half * f_B + g_W;
  const double dt2 = 0.5 * dt * dt;

  state.gyro_B = w_B + state.bias_w;
  state.a_WB = a_W;
  state.X_WB.p += dt * state.v_WB + dt2 * a_W;
  state.v_WB += dt * a_W;
  state.X_WB.q = (state.X_WB.q * exp_so3(dt * w_B)).normalized();
  state.bias_w += dt * state.imu.gyro_drift;

  // The gyro bias rotates the body at the end of the step and the force in its middle.
  const Eigen::Matrix3d turn = -dt * (state.X_WB.rotation() * right_jacobian_so3(dt * w_B));
  const Eigen::Matrix3d a_gyro = 0.5 * dt * R_half * skew(f_B) * right_jacobian_so3(0.5 * dt * w_B);
  const Eigen::Matrix3d g_tilt = skew(g_W);
  StepJacobians out;
  auto& F = out.F;
  F.block<3, 3>(kAttitude, kBiasW) = turn;
  F.block<3, 3>(kVelocity, kAttitude) = dt * g_tilt;
  F.block<3, 3>(kVelocity, kBiasF) = -dt * R_half;
  F.block<3, 3>(kVelocity, kBiasW) = dt * a_gyro + skew(state.v_WB) * turn;
  F.block<3, 3>(kPosition, kVelocity) = dt * Eigen::Matrix3d::Identity();
  F.block<3, 3>(kPosition, kAttitude) = dt2 * g_tilt;
  F.block<3, 3>(kPosition, kBiasF) = -dt2 * R_half;
  F.block<3, 3>(kPosition, kBiasW) = dt2 * a_gyro + skew(state.X_WB.p) * turn;
  add_parameter_jacobians(state.imu, w_B, f_B, dt, out);
  // White noise of the sensors enters like a change of their biases.
  out.G_w = F.middleCols<3>(kBiasW);
  out.G_w.middleRows<3>(kBiasW).setZero();
  out.G_f = F.middleCols<3>(kBiasF);
  out.G_f.middleRows<3>(kBiasF).setZero();
  if (!input.has_accelerometer) {
    // No sensor, no bias: only the white acceleration itself remains.
    F.middleCols<3>(kBiasF).setZero();
    F.block<3, 3>(kBiasF, kBiasF).setIdentity();
    out.by_parameters.setZero();
  }
  return out;
}

void propagate(MovingBody& state, MotionSinceImage& motion, const InertialInput& input,
               const Eigen::Vector3d& gravity_W, double dt) {
  if (dt <= 0) return;
  if (!motion.begun) motion.X_WB_before = state.X_WB;
  motion.begun = true;
  const double before_s = std::exchange(motion.seconds, motion.seconds + dt);
  if (input.v_B) return propagate_by_odometry(state, motion, input, dt);
  const StepJacobians j = step_mean(state, input, gravity_W, dt);
  add_step(j, motion.by_parameters);
  motion.by_parameters.middleCols<3>(gyro_drift(0) - gravity(0)) +=
      before_s * j.F.topRows<kBiasF>().middleCols<3>(kBiasW);
  add_step(j.F, motion.Phi);
  move_both_ways(j.F, motion.Q);
  Eigen::Matrix<double, kBiasF, 6> white;
  white << j.G_w.topRows<kBiasF>() * input.gyro_noise, j.G_f.topRows<kBiasF>() * input.accel_noise;
  white /= std::sqrt(dt);
  motion.Q.topLeftCorner<kBiasF, kBiasF>() += white.lazyProduct(white.transpose());
  motion.Q.diagonal().segment<3>(kBiasF).array() += input.accel_walk * input.accel_walk * dt;
  motion.Q.diagonal().segment<3>(kBiasW).array() += input.gyro_walk * input.gyro_walk * dt;
}

void apply(FilterState& state, MotionSinceImage& motion) {
  if (!motion.begun) return;
  std::swap(state.X_WB, motion.X_WB_before);
  camera_errors_to_extrinsics(state);
  std::swap(state.X_WB, motion.X_WB_before);
  auto P = state.P();
  const int first = layout::gravity(state.cameras());
  move_columns(motion.Phi, P.leftCols<kBodySize>());
  add_parameters(motion, {P.col(first).data(), P.outerStride()}, P.leftCols<kBodySize>());
  BodyMatrix body = P.topLeftCorner<kBodySize, kBodySize>().transpose();
  const Eigen::Matrix<double, kBodySize, kMotionSize> with_parameters =
      P.middleRows<kMotionSize>(first).leftCols<kBodySize>().transpose();
  move_columns(motion.Phi, body);
  add_parameters(motion, {with_parameters.data(), kBodySize}, body);
  P.topLeftCorner<kBodySize, kBodySize>() = body + motion.Q;
  for (Eigen::Index k = kBodySize; k < P.cols(); ++k)
    P.col(k).head<kBodySize>() = P.row(k).head<kBodySize>().transpose();
  propagate_drift(state, motion.seconds);
  for (int c = 0; c < state.cameras(); ++c) {
    double& shift = P(layout::clock(c), layout::clock(c));
    if (shift > 0) shift += kShiftWalk_s_rts * kShiftWalk_s_rts * motion.seconds;
  }
  extrinsics_to_camera_errors(state);
  motion.restart();
}

using namespace layout;        // NOLINT: block names
using namespace filter_rules;  // NOLINT: short names

Propagator::Propagator(const BodySensors& sensors, const EstimatorConfig& config)
    : sensors_(sensors),
      config_(config),
      gravity_W_(0, 0, -sensors.gravity_m_s2),
      imu_(sensors.imu.value_or(ImuNoise{}), config.max_imu_gap_s, config.motion_accel_m_s2_rtHz) {}

void Propagator::integrate(FilterState& state, Instant to, double variance, JumpSearch& path) {
  if (!sensors_.imu)
    return step_to(state, to, motion_without_imu(config_), kStepWithoutImu_s, variance, path);
  while (state.time < to) {
    const Instant end = imu_.end_of_interval(state.time, to);
    step_to(state, end, imu_.input_between(state.time, end), kStepWithImu_s, variance, path);
  }
}

void Propagator::step_to(FilterState& state, Instant to, InertialInput input, double longest_s,
                         double variance, JumpSearch& path) {
  input.scale_noise(std::sqrt(variance));
  while (state.time < to) {
    const Instant end = std::min(to, state.time + from_seconds(longest_s));
    propagate(state, motion_, input, gravity_W_, to_seconds(end - state.time));
    state.time = end;
    if (sensors_.imu) path.note_motion(end, state.X_WB);
  }
}

void Propagator::aim(FilterState& state, const Pose& X_B0B, double dt) {
  before_ = state;
  aimed_off_.setZero();
  const Eigen::Vector3d v_found = state.X_WB.q * X_B0B.p / dt;
  const Eigen::Vector3d bias_found = -log_so3(X_B0B.q) / dt;
  aimed_off_.segment<3>(kVelocity) = state.v_WB - v_found;
  aimed_off_.segment<3>(kBiasW) = state.bias_w - bias_found;
  state.v_WB = v_found;
  state.bias_w = bias_found;
}

void Propagator::finish_aimed(FilterState& state) {
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(state.size());
  moved.head<kBodySize>() = motion_.Phi * aimed_off_;
  for (int c = 0; c < state.cameras(); ++c)
    moved.segment<6>(layout::camera(c)) = moved.segment<6>(kPosition);
  apply(state, motion_);
  linearisation_ = state;
  state.add_error(moved);
}

}  // namespace fiducap::world
