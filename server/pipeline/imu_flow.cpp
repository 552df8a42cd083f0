#include "pipeline/imu_flow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

namespace fiducap {
namespace {

constexpr Duration kFlowWindow = std::chrono::seconds(5);
// After it the device may have been opened again.
constexpr Duration kFlowPause = std::chrono::seconds(1);
// The rate that is configured is often the usual one and not the device's; half of it is no fault.
constexpr double kSlow = 0.4;
// An attitude is not known over so long, whatever the rate.
constexpr Duration kHole = std::chrono::milliseconds(50);
constexpr double kStepsInAHole = 4;  // of a unit that is slow anyhow
constexpr int kFewHoles = 2;         // in a window; a busy machine leaves some
// At rest a coarse unit repeats itself, but seldom in all six numbers at once.
constexpr double kMany = 0.4;
constexpr int kFewReadings = 20;
constexpr int kSoundWindows = 3;

}  // namespace

void ImuFlow::add(const ImuSample& imu) {
  if (promised_hz_ <= 0) return;
  const std::optional<ImuSample> before = std::exchange(last_, imu);
  const Duration step = before ? imu.sampled_at - before->sampled_at : Duration{0};
  if (!before || step > kFlowPause || step < Duration{0}) {
    window_ = {.began = imu.sampled_at};
    seen_.reset();
    return;
  }
  ++window_.readings;
  if (imu.w_WB_B == before->w_WB_B && imu.f_B == before->f_B) ++window_.repeated;
  if (step > std::max(kHole, from_seconds(kStepsInAHole / promised_hz_))) ++window_.holes;
  window_.longest = std::max(window_.longest, step);
  if (imu.sampled_at - *window_.began >= kFlowWindow) end_window(imu.sampled_at);
}

std::optional<FlowFault> ImuFlow::judge(double seconds) const {
  const double rate_hz = window_.readings / seconds;
  if (window_.readings >= kFewReadings && window_.repeated == window_.readings)
    return FlowFault::kFrozen;
  if (rate_hz < kSlow * promised_hz_) return FlowFault::kSlow;
  if (window_.holes > kFewHoles) return FlowFault::kHoles;
  if (window_.repeated > kMany * window_.readings) return FlowFault::kRepeated;
  return std::nullopt;
}

void ImuFlow::end_window(Instant at) {
  const double seconds = to_seconds(at - *window_.began);
  const std::optional<FlowFault> found = judge(seconds);
  if (found && found == seen_ && found != fault_) {
    fault_ = found;
    told_ = window_;
    told_s_ = seconds;
  }
  seen_ = found;
  sound_windows_ = found ? 0 : sound_windows_ + 1;
  if (sound_windows_ >= kSoundWindows) fault_.reset();
  window_ = {.began = at};
}

std::string ImuFlow::text() const {
  if (!fault_) return {};
  const double rate_hz = told_.readings / told_s_;
  switch (*fault_) {
    case FlowFault::kFrozen:
      return fmt::format(
          "the IMU's readings are frozen: {} in a row are exactly the same. A sensor that lives "
          "has noise: look at its driver, its bus and its power",
          told_.readings);
    case FlowFault::kSlow:
      return fmt::format(
          "the IMU gives {:.0f} readings a second, {:.0f} are configured (rate_hz): its driver was "
          "not told, or its link cannot carry them. Below 100 a quick turn is not known well",
          rate_hz, promised_hz_);
    case FlowFault::kHoles:
      return fmt::format(
          "the IMU's readings have holes: {} in {:.0f} s, of up to {:.0f} ms. Some are lost on the "
          "way: look at its link (Wi-Fi, baud rate), and at what else this machine does",
          told_.holes, told_s_, to_seconds(told_.longest) * 1e3);
    case FlowFault::kRepeated:
      return fmt::format(
          "{:.0f} % of the IMU's readings repeat the one before: they are sent more often than the "
          "sensor measures. Ask for the rate that it has",
          100.0 * told_.repeated / told_.readings);
  }
  return {};
}

}  // namespace fiducap
