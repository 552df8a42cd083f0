#include "estimation/imu/output_predictor.hpp"

#include <algorithm>
#include <cmath>

#include "base/so3.hpp"

namespace fiducap {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using namespace estimate_block;

constexpr Duration kMemory = std::chrono::seconds(1);
constexpr double kMinSamples = 16;
constexpr double kMaxSamples = 8192;
// A turn of 5 rad/s bends the held force by 0.1 rad in this time: the mid-point rule is good to
// 4e-4 of it.
constexpr Duration kHoldStep = std::chrono::milliseconds(20);

/// How one step moves the error: p += dt v + dt²/2 Z, v += dt Z, θ += A b_w with Z = D_θ θ + D_f
/// b_f + D_w b_w.
struct ErrorStep {
  double dt{};
  Matrix3d D_attitude{Matrix3d::Zero()};
  Matrix3d D_bias_f{Matrix3d::Zero()};
  Matrix3d D_bias_w{Matrix3d::Zero()};
  Matrix3d A_bias_w{Matrix3d::Zero()};
};

/// F P from the left, row block by row block; the order leaves every block unchanged until it was
/// read.
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

/// White acceleration noise of density q (squared) over dt; dt < 0 runs backwards, the uncertainty
/// grows all the same.
void add_acceleration_noise(Matrix15d& P, double q, double dt) {
  const double span = std::abs(dt);
  add_diagonal(P, kPosition, q * span * span * span / 3.0);
  add_diagonal(P, kVelocity, q * span);
  P.block<3, 3>(kPosition, kVelocity).diagonal().array() += 0.5 * q * dt * span;
  P.block<3, 3>(kVelocity, kPosition).diagonal().array() += 0.5 * q * dt * span;
}

double square(double x) { return x * x; }

Saturated either(Saturated a, Saturated b) { return {a.gyro || b.gyro, a.accel || b.accel}; }

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
      watch_(noise_) {
  const double wanted = std::ceil(noise_.rate_hz * to_seconds(kMemory)) + 2;
  if (has_imu_)
    ring_.resize(static_cast<std::size_t>(std::clamp(wanted, kMinSamples, kMaxSamples)));
}

bool OutputPredictor::is_gap(Duration hole) const {
  return to_seconds(hole) > config_.max_imu_gap_s;
}

void OutputPredictor::add_imu(const ImuSample& imu) {
  if (!has_imu_ || !imu.w_WB_B.allFinite() || !imu.f_B.allFinite()) return;
  if (ring_size_ > 0 && imu.sampled_at <= reading(ring_size_ - 1).imu.sampled_at) {
    if (reading(ring_size_ - 1).imu.sampled_at - imu.sampled_at <= kMemory) return;
    ring_size_ = 0;
    head_ = before_head_ = base_;
  }
  push(imu);
  if (!head_ || imu.sampled_at <= head_->at) return;
  before_head_ = head_;
  advance(*head_, ring_size_ > 1 ? &reading(ring_size_ - 2) : nullptr, reading(ring_size_ - 1),
          imu.sampled_at);
}

void OutputPredictor::push(const ImuSample& imu) {
  if (ring_size_ == ring_.size()) {
    if (base_ && base_->at < reading(1).imu.sampled_at)
      advance(*base_, &reading(0), reading(1), reading(1).imu.sampled_at);
    ring_begin_ = (ring_begin_ + 1) % ring_.size();
    --ring_size_;
  }
  const auto found = watch_.look_at(imu);
  ring_[(ring_begin_ + ring_size_) % ring_.size()] = {imu, found.now};
  for (std::size_t k = 0; k < std::min(ring_size_, found.gyro_since); ++k)
    reading(ring_size_ - 1 - k).saturated.gyro = true;
  for (std::size_t k = 0; k < std::min(ring_size_, found.accel_since); ++k)
    reading(ring_size_ - 1 - k).saturated.accel = true;
  ++ring_size_;
}

void OutputPredictor::set_estimate(const BodyEstimate& estimate) {
  base_ = estimate;
  forget_before_base();
  head_ = before_head_ = base_;
  if (ring_size_ == 0) return;
  if (ring_size_ > 1) carry(*before_head_, reading(ring_size_ - 2).imu.sampled_at);
  head_ = before_head_;
  carry(*head_, reading(ring_size_ - 1).imu.sampled_at);
}

void OutputPredictor::forget_before_base() {
  while (ring_size_ > 1 && reading(1).imu.sampled_at <= base_->at) {
    ring_begin_ = (ring_begin_ + 1) % ring_.size();
    --ring_size_;
  }
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
  carry(*state, at);
  return state;
}

void OutputPredictor::carry(BodyEstimate& state, Instant to) const {
  // The sample after the state, searched from the newest: requests are recent.
  std::size_t next = ring_size_;
  while (next > 0 && reading(next - 1).imu.sampled_at > state.at) --next;
  for (; next < ring_size_ && state.at < to; ++next) {
    advance(state, next > 0 ? &reading(next - 1) : nullptr, reading(next),
            std::min(to, reading(next).imu.sampled_at));
  }
}

void OutputPredictor::advance(BodyEstimate& state, const JudgedReading* before,
                              const JudgedReading& after, Instant to) const {
  if (is_gap(after.imu.sampled_at - (before != nullptr ? before->imu.sampled_at : state.at))) {
    coast(state, to);
    if (to == after.imu.sampled_at) set_rates(state, after.imu);
    return;
  }
  const ImuSample* first = before != nullptr ? &before->imu : nullptr;
  integrate(state, on_line(first, after.imu, state.at + (to - state.at) / 2),
            before != nullptr ? either(before->saturated, after.saturated) : after.saturated, to);
  set_rates(state, on_line(first, after.imu, to));
}

void OutputPredictor::extrapolate(BodyEstimate& state, Instant to) const {
  if (ring_size_ > 0) {
    const JudgedReading& held = reading(ring_size_ - 1);
    const Instant end_of_hold =
        std::min(to, held.imu.sampled_at + from_seconds(config_.max_imu_gap_s));
    while (state.at < end_of_hold)
      integrate(state, held.imu, held.saturated, std::min(end_of_hold, state.at + kHoldStep));
    if (to == end_of_hold) set_rates(state, held.imu);
  }
  if (state.at < to) coast(state, to);
}

void OutputPredictor::integrate(BodyEstimate& state, const ImuSample& reading, Saturated saturated,
                                Instant to) const {
  const double dt = to_seconds(to - state.at);
  const Vector3d half_turn = (0.5 * dt) * (reading.w_WB_B - state.bias_w);
  const Eigen::Quaterniond half = exp_so3(half_turn);
  const Matrix3d R_start = state.X_WB.rotation();
  const Matrix3d R_mid = R_start * half.toRotationMatrix();
  const Matrix3d J_half = left_jacobian_so3(half_turn);
  const Vector3d force_W = R_mid * (reading.f_B - state.bias_f);
  const Vector3d a_W = force_W + gravity_W_;

  ErrorStep step;
  step.dt = dt;
  step.D_attitude = -skew(force_W);
  step.D_bias_f = -R_mid;
  step.D_bias_w = (0.5 * dt) * (skew(force_W) * (R_start * J_half));
  // J_l(φ) = ½ (1 + exp(φ/2)) J_l(φ/2): the integral of exp(sφ) cut into halves.
  step.A_bias_w = (-0.5 * dt) * ((R_start + R_mid) * J_half);
  transform(state.covariance, step);
  const double accel_noise =
      saturated.accel ? config_.motion_accel_m_s2_rtHz : noise_.accel_noise_m_s2_rtHz;
  const double gyro_noise = saturated.gyro ? kBlindRate_rad_s_rtHz : noise_.gyro_noise_rad_s_rtHz;
  add_acceleration_noise(state.covariance, square(accel_noise), dt);
  add_diagonal(state.covariance, kAttitude, square(gyro_noise) * dt);
  add_diagonal(state.covariance, kBiasF, square(noise_.accel_walk_m_s3_rtHz) * dt);
  add_diagonal(state.covariance, kBiasW, square(noise_.gyro_walk_rad_s2_rtHz) * dt);

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
  state.w_WB_B = reading.w_WB_B - state.bias_w;
  state.a_WB = state.X_WB.q * (reading.f_B - state.bias_f) + gravity_W_;
}

}  // namespace fiducap
