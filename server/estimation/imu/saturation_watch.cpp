#include "estimation/imu/saturation_watch.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {
constexpr double kChance = 1e-9;  // A run rarer than this is no chance.
constexpr double kLeastRepeats =
    0.01;  // No sensor's resolution is so fine that numbers never repeat.
constexpr double kMostRepeats = 0.9;
constexpr double kMemory = 400;  // readings
constexpr int kNeededChanges = 50;
constexpr double kNearRange = 0.998;

bool at_end(const Eigen::Vector3d& reading, double range) {
  return range > 0 && reading.cwiseAbs().maxCoeff() >= kNearRange * range;
}
}  // namespace

bool SaturationWatch::is_long(const Axis& axis) {
  if (axis.changes < kNeededChanges || axis.repeats > kMostRepeats) return false;
  return axis.run * std::log(std::max(axis.repeats, kLeastRepeats)) < std::log(kChance);
}

std::size_t SaturationWatch::judge(Axis& axis, double value, bool others_move) {
  if (value != axis.last) {
    // The run that ends here, unless it was the end of the range, tells how often numbers repeat.
    const int readings = axis.is_flat ? 1 : axis.run + 1;
    axis.repeats += std::min(1.0, readings / kMemory) * (1.0 - 1.0 / readings - axis.repeats);
    axis.changes = std::min(axis.changes + 1, kNeededChanges);
    axis.run = 0;
    axis.is_flat = false;
    axis.last = value;
    return 0;
  }
  ++axis.run;
  if (axis.is_flat || !others_move || !is_long(axis)) return 0;
  axis.is_flat = true;
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

}  // namespace fiducap
