#include "estimation/imu_buffer.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {
// Four seconds at 1 kHz: no camera is that slow, and no filter looks further back.
constexpr std::size_t kMostPending = 4096;
// A gap is bridged with this rate uncertainty.
constexpr double kGapRate_rad_s_rtHz = 1.0;
}  // namespace

ImuBuffer::ImuBuffer(const ImuNoise& noise, double max_gap_s, double gap_accel_noise)
    : noise_(noise), max_gap_s_(max_gap_s), gap_accel_noise_(gap_accel_noise) {
  samples_.reserve(kMostPending);
}

bool ImuBuffer::push(const ImuSample& imu) {
  if (!imu.w_WB_B.allFinite() || !imu.f_B.allFinite()) return false;
  if (!samples_.empty() && imu.sampled_at <= samples_.back().sampled_at) return false;
  if (is_full()) samples_.erase(samples_.begin());
  samples_.push_back(imu);
  return true;
}

std::optional<ImuSample> ImuBuffer::newest() const {
  return samples_.empty() ? std::nullopt : std::optional(samples_.back());
}

bool ImuBuffer::is_full() const { return samples_.size() >= kMostPending; }

void ImuBuffer::keep_newest_pair() {
  if (samples_.size() > 2) samples_.erase(samples_.begin(), samples_.end() - 2);
}

void ImuBuffer::forget_before(Instant at) {
  const std::size_t after = first_after(at);
  if (after > 1) samples_.erase(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(after - 1));
}

std::size_t ImuBuffer::first_after(Instant at) const {
  const auto after = std::upper_bound(samples_.begin(), samples_.end(), at,
                                      [](Instant t, const ImuSample& s) { return t < s.sampled_at; });
  return static_cast<std::size_t>(after - samples_.begin());
}

Instant ImuBuffer::end_of_interval(Instant from, Instant to) const {
  const std::size_t after = first_after(from);
  return after < samples_.size() ? std::min(to, samples_[after].sampled_at) : to;
}

InertialInput ImuBuffer::input_between(Instant from, Instant to) const {
  InertialInput input;
  input.gyro_noise = noise_.gyro_noise_rad_s_rtHz;
  input.accel_noise = noise_.accel_noise_m_s2_rtHz;
  input.gyro_walk = noise_.gyro_walk_rad_s2_rtHz;
  input.accel_walk = noise_.accel_walk_m_s3_rtHz;
  if (samples_.empty()) return input;
  const std::size_t after = std::min(first_after(from), samples_.size() - 1);
  const ImuSample& b = samples_[after];
  const ImuSample& a = samples_[after == 0 ? 0 : after - 1];
  const Duration span = b.sampled_at - a.sampled_at;
  const Instant middle = from + (to - from) / 2;
  const double share =
      span.count() > 0 ? std::clamp(to_seconds(middle - a.sampled_at) / to_seconds(span), 0.0, 1.0) : 1.0;
  input.w_B = a.w_WB_B + share * (b.w_WB_B - a.w_WB_B);
  input.f_B = a.f_B + share * (b.f_B - a.f_B);
  if (to_seconds(span) > max_gap_s_ || to_seconds(to - b.sampled_at) > max_gap_s_) {
    input.gyro_noise = std::hypot(input.gyro_noise, kGapRate_rad_s_rtHz);
    input.accel_noise = std::hypot(input.accel_noise, gap_accel_noise_);
  }
  return input;
}

}  // namespace fiducap
