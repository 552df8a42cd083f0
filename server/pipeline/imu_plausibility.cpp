#include "pipeline/imu_plausibility.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "base/numeric.hpp"

namespace fiducap {
namespace {

constexpr Duration kFlowWindow = std::chrono::seconds(5);
// After a longer gap the device may have been reopened.
constexpr Duration kFlowPause = std::chrono::seconds(1);
// The configured rate is often the usual one and not the device's; half of it is no fault.
constexpr double kSlow = 0.4;
// Longer gaps lose the attitude, at any rate.
constexpr Duration kHole = std::chrono::milliseconds(50);
constexpr double kStepsInAHole = 4;  // for slow devices
constexpr int kFewHoles = 2;         // in a window; a busy machine leaves some
// At rest a coarse unit repeats itself, but seldom in all six numbers at once.
constexpr double kMany = 0.4;
constexpr int kFewReadings = 20;
constexpr int kSoundWindows = 3;

// 400 forces then take four seconds at least: longer than a jump or a shake.
constexpr Duration kForceStep = std::chrono::milliseconds(10);
// After a longer gap the device may have been reopened or replaced.
constexpr Duration kPause = std::chrono::seconds(1);
// Sound judgements in a row that end a fault of the forces: 12 s.
constexpr int kSoundForces = 3;

std::optional<ImuFault> fault_of_force(double median_m_s2) {
  if (median_m_s2 < 0.4) return ImuFault::kForceWithoutGravity;
  if (median_m_s2 > 0.7 && median_m_s2 < 1.5) return ImuFault::kForceInG;
  if (median_m_s2 > 700 && median_m_s2 < 1500) return ImuFault::kForceInMilliG;
  if (median_m_s2 < 6.5 || median_m_s2 > 16) return ImuFault::kForceUnlikely;
  return std::nullopt;
}

}  // namespace

void ImuFlow::add(const ImuSample& imu) {
  if (configured_hz_ <= 0) return;
  const std::optional<ImuSample> before = std::exchange(last_, imu);
  const Duration step = before ? imu.sampled_at - before->sampled_at : Duration{0};
  if (!before || step > kFlowPause || step < Duration{0}) {
    window_ = {.began = imu.sampled_at};
    seen_.reset();
    return;
  }
  ++window_.readings;
  if (imu.w_WB_B == before->w_WB_B && imu.f_B == before->f_B) ++window_.repeated;
  if (step > std::max(kHole, from_seconds(kStepsInAHole / configured_hz_))) ++window_.holes;
  window_.longest = std::max(window_.longest, step);
  if (imu.sampled_at - *window_.began < kFlowWindow) return;
  const double seconds = to_seconds(imu.sampled_at - *window_.began);
  const std::optional<ImuFault> found = judge(seconds);
  if (found && found == seen_ && found != fault_) {
    fault_ = found;
    faulty_ = window_;
    faulty_s_ = seconds;
  }
  seen_ = found;
  sound_windows_ = found ? 0 : sound_windows_ + 1;
  if (sound_windows_ >= kSoundWindows) fault_.reset();
  window_ = {.began = imu.sampled_at};
}

std::optional<ImuFault> ImuFlow::judge(double seconds) const {
  const double rate_hz = window_.readings / seconds;
  if (window_.readings >= kFewReadings && window_.repeated == window_.readings)
    return ImuFault::kFrozen;
  if (rate_hz < kSlow * configured_hz_) return ImuFault::kSlow;
  if (window_.holes > kFewHoles) return ImuFault::kHoles;
  if (window_.repeated > kMany * window_.readings) return ImuFault::kRepeated;
  return std::nullopt;
}

std::string ImuFlow::text() const {
  if (!fault_) return {};
  const double rate_hz = faulty_.readings / faulty_s_;
  switch (*fault_) {
    case ImuFault::kFrozen:
      return fmt::format(
          "the IMU's readings are frozen: {} in a row are exactly the same. A working sensor has "
          "noise: check its driver, its bus and its power",
          faulty_.readings);
    case ImuFault::kSlow:
      return fmt::format(
          "the IMU gives {:.0f} readings a second, {:.0f} are configured (rate_hz): its driver is "
          "set to another rate, or its link is too slow. Below 100 fast rotations are inaccurate",
          rate_hz, configured_hz_);
    case ImuFault::kHoles:
      return fmt::format(
          "the IMU's readings have gaps: {} in {:.0f} s, of up to {:.0f} ms. Check its link "
          "(Wi-Fi, baud rate) and the load of this machine",
          faulty_.holes, faulty_s_, to_seconds(faulty_.longest) * 1e3);
    default:
      return fmt::format(
          "{:.0f} % of the IMU's readings repeat the one before: they are sent more often than the "
          "sensor measures. Request the sensor's own rate",
          100.0 * faulty_.repeated / faulty_.readings);
  }
}

std::string_view text_of(ImuFault fault) {
  switch (fault) {
    case ImuFault::kForceInG:
      return "the accelerometer seems to be in g: its median is about 1, expected are m/s² (9.81 "
             "at rest). Multiply its readings by 9.80665";
    case ImuFault::kForceInMilliG:
      return "the accelerometer seems to be in thousandths of g: its median is about 1000, "
             "expected are m/s² (9.81 at rest). Multiply its readings by 0.00980665";
    case ImuFault::kForceWithoutGravity:
      return "the accelerometer shows no gravity: its median is about 0, expected is 9.81 m/s² at "
             "rest. Use its raw readings, not the linear acceleration of an attitude filter, or "
             "check the sensor";
    case ImuFault::kForceUnlikely:
      return "the accelerometer's median is far from gravity (9.81 m/s²). Check its unit, range "
             "and scale";
    case ImuFault::kRateInDegreesPerSecond:
      return "the gyro seems to be in degrees per second: its rotations are 57 times those of the "
             "tags; expected are rad/s. Multiply its readings by 0.0174533";
    default:
      return "the IMU's readings do not arrive as expected";
  }
}

std::vector<ImuFault> faults_to_report(const ImuFaults& before, const ImuFaults& now) {
  std::vector<ImuFault> all;
  const bool none_ended = std::equal(before.begin(), before.end(), now.begin(),
                                     [](const auto& b, const auto& n) { return !b || n; });
  for (std::size_t i = 0; i < now.size(); ++i)
    if (now[i] && (!none_ended || now[i] != before[i])) all.push_back(*now[i]);
  return all;
}

void ImuPlausibility::add(const ImuSample& imu) {
  if (last_at_ && imu.sampled_at - *last_at_ > kPause) {
    // A fault holds until the opposite is found.
    forces_ = 0;
    sound_forces_ = 0;
    last_force_at_.reset();
  }
  last_at_ = imu.sampled_at;
  flow_.add(imu);
  if (forces_ < kForces && (!last_force_at_ || imu.sampled_at - *last_force_at_ >= kForceStep)) {
    last_force_at_ = imu.sampled_at;
    forces_m_s2_[forces_++] = imu.f_B.norm();
    if (forces_ == kForces) judge_forces();
  }
}

void ImuPlausibility::judge_forces() {
  const std::optional<ImuFault> found = fault_of_force(nth_smallest(forces_m_s2_, kForces / 2));
  sound_forces_ = found ? 0 : sound_forces_ + 1;
  if (found) force_fault_ = found;
  if (!force_fault_) return;
  forces_ = 0;  // checked until the fault ends
  if (sound_forces_ >= kSoundForces) force_fault_.reset();
}

std::string ImuPlausibility::text(ImuFault fault) const {
  return fault == flow_.fault() ? flow_.text() : std::string(text_of(fault));
}

}  // namespace fiducap
