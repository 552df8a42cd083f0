#include "estimation/imu/imu_buffer.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {
// A unit may be somewhat quicker than it is said to be; and whatever is said, memory is bounded.
constexpr double kMargin = 1.25;
constexpr double kFewest = 256;
constexpr double kMost = 65536;

std::size_t most_readings(double rate_hz) {
  const double wanted = kMargin * rate_hz * to_seconds(kFilterPast);
  return static_cast<std::size_t>(std::clamp(std::ceil(wanted), kFewest, kMost));
}
}  // namespace

ImuBuffer::ImuBuffer(const ImuNoise& noise, double max_gap_s, double gap_accel_noise)
    : noise_(noise),
      most_(most_readings(noise.rate_hz)),
      max_gap_s_(max_gap_s),
      gap_accel_noise_(gap_accel_noise),
      watch_(noise) {
  samples_.reserve(most_);
}

bool ImuBuffer::push(const ImuSample& imu) {
  if (!imu.w_WB_B.allFinite() || !imu.f_B.allFinite()) return false;
  if (!samples_.empty() && imu.sampled_at <= samples_.back().imu.sampled_at) return false;
  if (is_full()) samples_.erase(samples_.begin());
  const auto found = watch_.look_at(imu);
  samples_.push_back({imu, found.now});
  const std::size_t earlier = samples_.size() - 1;
  for (std::size_t k = 1; k <= std::min(earlier, found.gyro_since); ++k)
    samples_[earlier - k].saturated.gyro = true;
  for (std::size_t k = 1; k <= std::min(earlier, found.accel_since); ++k)
    samples_[earlier - k].saturated.accel = true;
  return true;
}

std::optional<ImuSample> ImuBuffer::newest() const {
  return samples_.empty() ? std::nullopt : std::optional(samples_.back().imu);
}

bool ImuBuffer::is_full() const { return samples_.size() >= most_; }

void ImuBuffer::keep_newest_pair() {
  if (samples_.size() > 2) samples_.erase(samples_.begin(), samples_.end() - 2);
}

void ImuBuffer::forget_before(Instant at) {
  const std::size_t after = first_after(at);
  if (after > 1)
    samples_.erase(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(after - 1));
}

std::size_t ImuBuffer::first_after(Instant at) const {
  const auto after =
      std::upper_bound(samples_.begin(), samples_.end(), at,
                       [](Instant t, const JudgedReading& r) { return t < r.imu.sampled_at; });
  return static_cast<std::size_t>(after - samples_.begin());
}

Instant ImuBuffer::end_of_interval(Instant from, Instant to) const {
  const std::size_t after = first_after(from);
  return after < samples_.size() ? std::min(to, samples_[after].imu.sampled_at) : to;
}

InertialInput ImuBuffer::input_between(Instant from, Instant to) const {
  InertialInput input;
  input.gyro_noise = noise_.gyro_noise_rad_s_rtHz;
  input.accel_noise = noise_.accel_noise_m_s2_rtHz;
  input.gyro_walk = noise_.gyro_walk_rad_s2_rtHz;
  input.accel_walk = noise_.accel_walk_m_s3_rtHz;
  if (samples_.empty()) {
    input.gyro_noise = std::hypot(input.gyro_noise, kBlindRate_rad_s_rtHz);
    input.accel_noise = std::hypot(input.accel_noise, gap_accel_noise_);
    return input;
  }
  const std::size_t after = std::min(first_after(from), samples_.size() - 1);
  const JudgedReading& last = samples_[after];
  const JudgedReading& first = samples_[after == 0 ? 0 : after - 1];
  const ImuSample& b = last.imu;
  const ImuSample& a = first.imu;
  const Duration span = b.sampled_at - a.sampled_at;
  const Instant middle = from + (to - from) / 2;
  const double share =
      span.count() > 0 ? std::clamp(to_seconds(middle - a.sampled_at) / to_seconds(span), 0.0, 1.0)
                       : 1.0;
  input.w_B = a.w_WB_B + share * (b.w_WB_B - a.w_WB_B);
  input.f_B = a.f_B + share * (b.f_B - a.f_B);
  const bool gap = to_seconds(span) > max_gap_s_ || to_seconds(to - b.sampled_at) > max_gap_s_ ||
                   to_seconds(a.sampled_at - from) > max_gap_s_;
  if (gap || first.saturated.gyro || last.saturated.gyro)
    input.gyro_noise = std::hypot(input.gyro_noise, kBlindRate_rad_s_rtHz);
  if (gap || first.saturated.accel || last.saturated.accel)
    input.accel_noise = std::hypot(input.accel_noise, gap_accel_noise_);
  return input;
}

}  // namespace fiducap
