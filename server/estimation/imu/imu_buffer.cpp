#include "estimation/imu/imu_buffer.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {
constexpr double kChance = 1e-9;        // Probability below which a run is no chance.
constexpr double kLeastRepeats = 0.01;  // Every sensor repeats values.
constexpr double kMostRepeats = 0.9;
constexpr double kRunMemory = 400;  // samples
constexpr int kNeededChanges = 50;
constexpr double kNearRange = 0.998;

// Margin of the unit's configured rate, and bounds of the memory.
constexpr double kMargin = 1.25;
constexpr double kFewest = 256;
constexpr double kMost = 65536;

bool at_end(const Eigen::Vector3d& reading, double range) {
  return range > 0 && reading.cwiseAbs().maxCoeff() >= kNearRange * range;
}

std::size_t most_readings(double rate_hz, Duration past) {
  const double wanted = kMargin * rate_hz * to_seconds(past);
  return static_cast<std::size_t>(std::clamp(std::ceil(wanted), kFewest, kMost));
}
}  // namespace

std::size_t SaturationWatch::judge(Axis& axis, double value, bool others_move) {
  if (value != axis.last) {
    // A run that was no saturation gives the share of repeats.
    const int readings = axis.is_flat ? 1 : axis.run + 1;
    axis.repeats += std::min(1.0, readings / kRunMemory) * (1.0 - 1.0 / readings - axis.repeats);
    axis.changes = std::min(axis.changes + 1, kNeededChanges);
    axis.run = 0;
    axis.is_flat = false;
    axis.last = value;
    return 0;
  }
  ++axis.run;
  if (axis.is_flat || !others_move || axis.changes < kNeededChanges || axis.repeats > kMostRepeats)
    return 0;
  axis.is_flat = axis.run * std::log(std::max(axis.repeats, kLeastRepeats)) < std::log(kChance);
  if (!axis.is_flat) return 0;
  return static_cast<std::size_t>(axis.run);
}

SaturationWatch::Finding SaturationWatch::look_at(const ImuSample& imu) {
  std::array<double, 6> values{};
  Eigen::Map<Eigen::Vector3d>(values.data()) = imu.w_WB_B;
  Eigen::Map<Eigen::Vector3d>(values.data() + 3) = imu.f_B;
  bool any_moves = false;
  for (std::size_t i = 0; i < values.size(); ++i) any_moves |= values[i] != axes_[i].last;
  Finding found;
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::size_t& since = i < 3 ? found.gyro_since : found.accel_since;
    since = std::max(since, judge(axes_[i], values[i], any_moves));
    (i < 3 ? found.now.gyro : found.now.accel) |= axes_[i].is_flat;
  }
  found.now.gyro |= at_end(imu.w_WB_B, unit_.gyro_range_rad_s);
  found.now.accel |= at_end(imu.f_B, unit_.accel_range_m_s2);
  return found;
}

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
  const auto note_range = [](double& met, bool is_met, const Eigen::Vector3d& reading) {
    if (is_met) met = std::max(met, reading.cwiseAbs().maxCoeff());
  };
  note_range(ranges_met_.gyro_rad_s, found.now.gyro, imu.w_WB_B);
  note_range(ranges_met_.accel_m_s2, found.now.accel, imu.f_B);
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
  // Searches from the newest: requests are recent.
  std::size_t after = size_;
  std::size_t step = 1;
  while (after > 0 && reading(after - 1).imu.sampled_at > at) {
    // Doubling steps back, then bisection.
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
