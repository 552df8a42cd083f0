#include "estimation/imu/imu_buffer.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {
// A unit may be somewhat quicker than it is said to be; and whatever is said, memory is bounded.
constexpr double kMargin = 1.25;
constexpr double kFewest = 256;
constexpr double kMost = 65536;

std::size_t most_readings(double rate_hz, Duration past) {
  const double wanted = kMargin * rate_hz * to_seconds(past);
  return static_cast<std::size_t>(std::clamp(std::ceil(wanted), kFewest, kMost));
}
}  // namespace

ImuBuffer::ImuBuffer(const ImuNoise& noise, double max_gap_s, double gap_accel_noise, Duration past)
    : noise_(noise),
      max_gap_s_(max_gap_s),
      gap_accel_noise_(gap_accel_noise),
      watch_(noise),
      ring_(most_readings(noise.rate_hz, past)) {}

bool ImuBuffer::push(const ImuSample& imu) {
  if (!imu.w_WB_B.allFinite() || !imu.f_B.allFinite()) return false;
  if (size_ > 0 && imu.sampled_at <= reading(size_ - 1).imu.sampled_at) return false;
  if (is_full()) forget_oldest(1);
  const auto found = watch_.look_at(imu);
  const auto meet = [](double& met, bool is_met, const Eigen::Vector3d& reading) {
    if (is_met) met = std::max(met, reading.cwiseAbs().maxCoeff());
  };
  meet(ranges_met_.gyro_rad_s, found.now.gyro, imu.w_WB_B);
  meet(ranges_met_.accel_m_s2, found.now.accel, imu.f_B);
  const std::size_t earlier = size_++;
  at(earlier) = {noise_.correction ? noise_.correction->apply(imu) : imu, found.now};
  for (std::size_t k = 1; k <= std::min(earlier, found.gyro_since); ++k)
    at(earlier - k).saturated.gyro = true;
  for (std::size_t k = 1; k <= std::min(earlier, found.accel_since); ++k)
    at(earlier - k).saturated.accel = true;
  return true;
}

std::optional<ImuSample> ImuBuffer::newest() const {
  return size_ == 0 ? std::nullopt : std::optional(reading(size_ - 1).imu);
}

void ImuBuffer::forget_all() {
  size_ = 0;
  watch_ = SaturationWatch(noise_);
}

void ImuBuffer::forget_oldest(std::size_t count) {
  begin_ = (begin_ + count) % ring_.size();
  size_ -= count;
}

void ImuBuffer::keep_newest_pair() {
  if (size_ > 2) forget_oldest(size_ - 2);
}

void ImuBuffer::forget_before(Instant at) {
  const std::size_t after = first_after(at);
  if (after > 1) forget_oldest(after - 1);
}

std::size_t ImuBuffer::first_after(Instant at) const {
  // Looked for from the newest: questions are recent.
  std::size_t after = size_;
  std::size_t step = 1;
  while (after > 0 && reading(after - 1).imu.sampled_at > at) {
    // Doubling steps back, then halving between.
    const std::size_t back = std::min(step, after);
    if (reading(after - back).imu.sampled_at > at) {
      after -= back;
      step *= 2;
    } else {
      step = std::max<std::size_t>(1, back / 2);
    }
  }
  return after;
}

Instant ImuBuffer::end_of_interval(Instant from, Instant to) const {
  const std::size_t after = first_after(from);
  return after < size_ ? std::min(to, reading(after).imu.sampled_at) : to;
}

InertialInput ImuBuffer::input_between(Instant from, Instant to) const {
  InertialInput input;
  input.gyro_noise = noise_.gyro_noise_rad_s_rtHz;
  input.accel_noise = noise_.accel_noise_m_s2_rtHz;
  input.gyro_walk = noise_.gyro_walk_rad_s2_rtHz;
  input.accel_walk = noise_.accel_walk_m_s3_rtHz;
  bool is_gap_here = size_ == 0;
  Saturated saturated;
  if (size_ > 0) {
    const std::size_t after = std::min(first_after(from), size_ - 1);
    const JudgedReading& last = reading(after);
    const bool is_held = after == 0 || from >= last.imu.sampled_at;
    const JudgedReading& first = reading(is_held ? after : after - 1);
    const ImuSample& b = last.imu;
    const ImuSample& a = first.imu;
    const Duration span = b.sampled_at - a.sampled_at;
    const Instant middle = from + (to - from) / 2;
    const double share =
        span.count() > 0
            ? std::clamp(to_seconds(middle - a.sampled_at) / to_seconds(span), 0.0, 1.0)
            : 1.0;
    input.w_B = a.w_WB_B + share * (b.w_WB_B - a.w_WB_B);
    input.f_B = a.f_B + share * (b.f_B - a.f_B);
    is_gap_here = is_gap(span) || is_gap(to - b.sampled_at) || is_gap(a.sampled_at - from);
    saturated = {first.saturated.gyro || last.saturated.gyro,
                 first.saturated.accel || last.saturated.accel};
  }
  if (is_gap_here || saturated.gyro)
    input.gyro_noise = std::hypot(input.gyro_noise, kBlindRate_rad_s_rtHz);
  if (is_gap_here || saturated.accel)
    input.accel_noise = std::hypot(input.accel_noise, gap_accel_noise_);
  return input;
}

}  // namespace fiducap
