#include "capture/reading_pairs.hpp"

#include <charconv>
#include <cmath>

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

std::optional<ReadingPairs::Pair> ReadingPairs::take() {
  while (gyro_.size > 0) {
    const Timed& gyro = gyro_.at(0);
    while (accel_.size >= 2 && accel_.at(1).stamp_ns <= gyro.stamp_ns) accel_.pop();
    if (accel_.size == 0) return std::nullopt;
    const Timed& before = accel_.at(0);
    if (before.stamp_ns > gyro.stamp_ns) {  // no accelerometer reading before it
      gyro_.pop();
      ++gyro_.dropped;
      continue;
    }
    if (accel_.size < 2 && before.stamp_ns < gyro.stamp_ns) return std::nullopt;
    Pair pair{gyro.stamp_ns, gyro.value, before.value};
    if (before.stamp_ns < gyro.stamp_ns) {
      const Timed& after = accel_.at(1);
      if (after.stamp_ns - before.stamp_ns > kLongestGap.count()) {
        gyro_.pop();
        ++gyro_.dropped;
        continue;
      }
      const double share = static_cast<double>(gyro.stamp_ns - before.stamp_ns) /
                           static_cast<double>(after.stamp_ns - before.stamp_ns);
      pair.f += share * (after.value - before.value);
    }
    gyro_.pop();
    return pair;
  }
  return std::nullopt;
}

std::optional<Eigen::Matrix3d> parse_mount_matrix(std::string_view text) {
  constexpr double kOrthonormal = 0.01;  // hand-written numbers
  constexpr std::string_view kBetween = " ,;\n\t";
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 9; ++i) {
    text.remove_prefix(std::min(text.find_first_not_of(kBetween), text.size()));
    double value = 0;
    const auto [stopped, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failure != std::errc{} || !std::isfinite(value)) return std::nullopt;
    text.remove_prefix(static_cast<std::size_t>(stopped - text.data()));
    matrix(i / 3, i % 3) = value;
  }
  const bool is_over = text.find_first_not_of(kBetween) == std::string_view::npos;
  const double off = (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).norm();
  return is_over && off < kOrthonormal ? std::optional(matrix) : std::nullopt;
}

}  // namespace fiducap
