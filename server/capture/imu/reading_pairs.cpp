#include "capture/imu/reading_pairs.hpp"

namespace fiducap {

void ReadingPairs::Queue::add(const Timed& reading) {
  if (newest && reading.stamp_ns <= *newest) {
    ++dropped;
    return;
  }
  newest = reading.stamp_ns;
  if (size == kMost) {
    pop();
    ++dropped;
  }
  ring[(first + size) % kMost] = reading;
  ++size;
}

void ReadingPairs::Queue::pop() {
  first = (first + 1) % kMost;
  --size;
}

std::optional<ReadingPairs::Pair> ReadingPairs::take() {
  while (gyro_.size > 0) {
    const Timed& gyro = gyro_.at(0);
    while (accel_.size >= 2 && accel_.at(1).stamp_ns <= gyro.stamp_ns) accel_.pop();
    if (accel_.size == 0) return std::nullopt;
    const Timed& before = accel_.at(0);
    if (before.stamp_ns > gyro.stamp_ns) {  // nobody knows what the accelerometer felt then
      gyro_.pop();
      ++gyro_.dropped;
      continue;
    }
    if (accel_.size < 2 && before.stamp_ns < gyro.stamp_ns) return std::nullopt;
    Pair pair{gyro.stamp_ns, gyro.value, before.value};
    if (before.stamp_ns < gyro.stamp_ns) {
      const Timed& after = accel_.at(1);
      const double share = static_cast<double>(gyro.stamp_ns - before.stamp_ns) /
                           static_cast<double>(after.stamp_ns - before.stamp_ns);
      pair.f += share * (after.value - before.value);
    }
    gyro_.pop();
    return pair;
  }
  return std::nullopt;
}

}  // namespace fiducap
