#include "estimation/imu/output_predictor.hpp"

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"

namespace fiducap {

namespace {
using Eigen::Matrix3d;
using Eigen::Vector3d;
using namespace estimate_block;

constexpr Duration kMemory = std::chrono::seconds(1);
// At 5 rad/s the held force rotates by 0.1 rad in this time: relative error of the mid-point rule
// 4e-4.
constexpr Duration kHoldStep = std::chrono::milliseconds(20);

/// Error propagation of one step: p += dt v + dt²/2 Z, v += dt Z, θ += A b_w with
/// Z = D_θ θ + D_f b_f + D_w b_w.
struct ErrorStep {
  double dt{};
  Matrix3d D_attitude{Matrix3d::Zero()};
  Matrix3d D_bias_f{Matrix3d::Zero()};
  Matrix3d D_bias_w{Matrix3d::Zero()};
  Matrix3d A_bias_w{Matrix3d::Zero()};
};

/// P ← F P by row blocks, in an order in which no block changes before it is read.
template <typename Covariance>
void apply_to_rows(const ErrorStep& step, Covariance&& P) {
  const Eigen::Matrix<double, 3, 15> Z = step.D_attitude * P.template middleRows<3>(kAttitude) +
                                         step.D_bias_f * P.template middleRows<3>(kBiasF) +
                                         step.D_bias_w * P.template middleRows<3>(kBiasW);
  P.template middleRows<3>(kPosition) +=
      step.dt * P.template middleRows<3>(kVelocity) + (0.5 * step.dt * step.dt) * Z;
  P.template middleRows<3>(kVelocity) += step.dt * Z;
  P.template middleRows<3>(kAttitude) += step.A_bias_w * P.template middleRows<3>(kBiasW);
}

void transform(Matrix15d& P, const ErrorStep& step) {
  apply_to_rows(step, P);
  P.transposeInPlace();
  apply_to_rows(step, P);
}

void add_diagonal(Matrix15d& P, int block, double variance) {
  P.diagonal().segment<3>(block).array() += variance;
}

/// White acceleration noise of density q (squared) over dt, which may be negative.
void add_acceleration_noise(Matrix15d& P, double q, double dt) {
  const double span = std::abs(dt);
  add_diagonal(P, kPosition, q * span * span * span / 3.0);
  add_diagonal(P, kVelocity, q * span);
  P.block<3, 3>(kPosition, kVelocity).diagonal().array() += 0.5 * q * dt * span;
  P.block<3, 3>(kVelocity, kPosition).diagonal().array() += 0.5 * q * dt * span;
}

double square(double x) { return x * x; }

ImuSample on_line(const ImuSample* before, const ImuSample& after, Instant at) {
  if (before == nullptr) return after;
  const double k =
      to_seconds(at - before->sampled_at) / to_seconds(after.sampled_at - before->sampled_at);
  ImuSample between;
  between.sampled_at = at;
  between.w_WB_B = before->w_WB_B + k * (after.w_WB_B - before->w_WB_B);
  between.f_B = before->f_B + k * (after.f_B - before->f_B);
  return between;
}
}  // namespace

OutputPredictor::OutputPredictor(const BodySensors& sensors, const EstimatorConfig& config)
    : has_imu_(sensors.imu.has_value()),
      noise_(sensors.imu.value_or(ImuNoise{})),
      config_(config),
      gravity_W_(0, 0, -sensors.gravity_m_s2),
      imu_(noise_, config.max_imu_gap_s, config.motion_accel_m_s2_rtHz, kMemory) {}

void OutputPredictor::add_imu(const ImuSample& imu) {
  if (!has_imu_ || !imu.w_WB_B.allFinite() || !imu.f_B.allFinite()) return;
  const auto newest = imu_.newest();
  if (newest && imu.sampled_at <= newest->sampled_at) {
    if (newest->sampled_at - imu.sampled_at <= kMemory) return;
    imu_.forget_all();
    head_ = before_head_ = base_;
  }
  // The oldest sample is dropped next: base_ is propagated over its interval.
  if (imu_.is_full() && base_ && base_->at < imu_.reading(1).imu.sampled_at)
    advance(*base_, 1, imu_.reading(1).imu.sampled_at);
  imu_.push(imu);
  if (!head_ || imu.sampled_at <= head_->at) return;
  before_head_ = head_;
  advance(*head_, imu_.size() - 1, imu.sampled_at);
}

void OutputPredictor::set_estimate(const BodyEstimate& estimate) {
  base_ = estimate;
  imu_.forget_before(base_->at);
  head_ = before_head_ = base_;
  const std::size_t readings = imu_.size();
  if (readings == 0) return;
  if (readings > 1) transport(*before_head_, imu_.reading(readings - 2).imu.sampled_at);
  head_ = before_head_;
  transport(*head_, imu_.reading(readings - 1).imu.sampled_at);
}

void OutputPredictor::clear() {
  base_.reset();
  head_.reset();
  before_head_.reset();
}

std::optional<BodyEstimate> OutputPredictor::predict(Instant at) const {
  if (!base_) return std::nullopt;
  if (at >= head_->at) {
    auto state = head_;
    extrapolate(*state, at);
    return state;
  }
  if (at < base_->at) {
    auto state = base_;
    coast(*state, at);
    return state;
  }
  auto state = at >= before_head_->at ? before_head_ : base_;
  transport(*state, at);
  return state;
}

void OutputPredictor::transport(BodyEstimate& state, Instant to) const {
  for (std::size_t next = imu_.first_after(state.at); next < imu_.size() && state.at < to; ++next)
    advance(state, next, std::min(to, imu_.reading(next).imu.sampled_at));
}

void OutputPredictor::advance(BodyEstimate& state, std::size_t next, Instant to) const {
  const ImuSample& after = imu_.reading(next).imu;
  const ImuSample* before = next > 0 ? &imu_.reading(next - 1).imu : nullptr;
  if (imu_.is_gap(after.sampled_at - (before != nullptr ? before->sampled_at : state.at))) {
    coast(state, to);
    if (to == after.sampled_at) set_rates(state, after);
    return;
  }
  integrate(state, imu_.input_between(state.at, to), to);
  set_rates(state, on_line(before, after, to));
}

void OutputPredictor::extrapolate(BodyEstimate& state, Instant to) const {
  if (const auto held = imu_.newest()) {
    const Instant end_of_hold =
        std::min(to, held->sampled_at + from_seconds(config_.max_imu_gap_s));
    while (state.at < end_of_hold) {
      const Instant end = std::min(end_of_hold, state.at + kHoldStep);
      integrate(state, imu_.input_between(end, end), end);
    }
    if (to == end_of_hold) set_rates(state, *held);
  }
  if (state.at < to) coast(state, to);
}

void OutputPredictor::integrate(BodyEstimate& state, const InertialInput& input, Instant to) const {
  const double dt = to_seconds(to - state.at);
  const Vector3d half_turn = (0.5 * dt) * state.imu.rate(input.w_B - state.bias_w);
  const Eigen::Quaterniond half = exp_so3(half_turn);
  const Matrix3d R_start = state.X_WB.rotation();
  const Matrix3d R_mid = R_start * half.toRotationMatrix();
  const Matrix3d J_half = left_jacobian_so3(half_turn);
  const Vector3d force_W = R_mid * state.imu.force(input.f_B - state.bias_f);
  const Vector3d a_W = force_W + gravity_W_ - state.gravity_offset_m_s2 * Vector3d::UnitZ();

  ErrorStep step;
  step.dt = dt;
  step.D_attitude = -skew(force_W);
  step.D_bias_f = -R_mid;
  step.D_bias_w = (0.5 * dt) * (skew(force_W) * (R_start * J_half));
  // J_l(φ) = ½ (1 + exp(φ/2)) J_l(φ/2): the integral of exp(sφ) in two halves.
  step.A_bias_w = (-0.5 * dt) * ((R_start + R_mid) * J_half);
  transform(state.covariance, step);
  add_acceleration_noise(state.covariance, square(input.accel_noise), dt);
  add_diagonal(state.covariance, kAttitude, square(input.gyro_noise) * dt);
  add_diagonal(state.covariance, kBiasF, square(input.accel_walk) * dt);
  add_diagonal(state.covariance, kBiasW, square(input.gyro_walk) * dt);

  state.X_WB.p += dt * state.v_WB + (0.5 * dt * dt) * a_W;
  state.v_WB += dt * a_W;
  state.X_WB.q = (state.X_WB.q * (half * half)).normalized();
  state.at = to;
}

void OutputPredictor::coast(BodyEstimate& state, Instant to) const {
  const double dt = to_seconds(to - state.at);
  if (!has_imu_) state.w_WB_B = -state.bias_w;
  const Vector3d turn = dt * state.w_WB_B;

  ErrorStep step;
  step.dt = dt;
  step.A_bias_w = -dt * (state.X_WB.rotation() * left_jacobian_so3(turn));
  transform(state.covariance, step);
  add_acceleration_noise(state.covariance, square(config_.motion_accel_m_s2_rtHz), dt);
  const double q_w = square(config_.motion_angular_rad_s2_rtHz);
  const double span = std::abs(dt);
  add_diagonal(state.covariance, kAttitude, q_w * span * span * span / 3.0);
  if (has_imu_) {
    add_diagonal(state.covariance, kBiasF, square(noise_.accel_walk_m_s3_rtHz) * span);
    add_diagonal(state.covariance, kBiasW, square(noise_.gyro_walk_rad_s2_rtHz) * span);
  } else {
    add_diagonal(state.covariance, kBiasW, q_w * span);
    const Matrix3d cross = (0.5 * q_w * span) * step.A_bias_w;
    state.covariance.block<3, 3>(kAttitude, kBiasW) += cross;
    state.covariance.block<3, 3>(kBiasW, kAttitude) += cross.transpose();
  }

  state.X_WB.p += dt * state.v_WB;
  state.X_WB.q = (state.X_WB.q * exp_so3(turn)).normalized();
  state.a_WB.setZero();
  state.at = to;
}

void OutputPredictor::set_rates(BodyEstimate& state, const ImuSample& reading) const {
  state.w_WB_B = state.imu.rate(reading.w_WB_B - state.bias_w);
  state.a_WB = state.X_WB.q * state.imu.force(reading.f_B - state.bias_f) + gravity_W_ -
               state.gravity_offset_m_s2 * Vector3d::UnitZ();
}

}  // namespace fiducap
