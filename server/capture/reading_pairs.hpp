#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "base/time.hpp"

namespace fiducap {

/// Combines gyroscope and accelerometer of two devices: interpolates the accelerometer linearly at
/// the times of the gyroscope, never over a longer gap. At most 256 wait for it; others are dropped
/// and counted.
class ReadingPairs final {
 public:
  static constexpr Duration kLongestGap = std::chrono::milliseconds(100);
  struct Timed {
    std::int64_t stamp_ns{};
    Eigen::Vector3d value{Eigen::Vector3d::Zero()};
  };
  struct Pair {
    std::int64_t stamp_ns{};
    Eigen::Vector3d w{Eigen::Vector3d::Zero()};
    Eigen::Vector3d f{Eigen::Vector3d::Zero()};
  };

  /// Readings whose time does not increase are dropped.
  void add_gyro(const Timed& reading) { gyro_.add(reading); }
  void add_accel(const Timed& reading) { accel_.add(reading); }
  [[nodiscard]] std::optional<Pair> take();

  /// The gyroscope is to be read next.
  [[nodiscard]] bool gyro_is_behind() const { return gyro_.newest_ns() <= accel_.newest_ns(); }
  [[nodiscard]] std::uint64_t dropped() const { return gyro_.dropped + accel_.dropped; }

 private:
  struct Queue {
    static constexpr std::size_t kMost = 256;
    std::array<Timed, kMost> ring{};
    std::size_t first{0};
    std::size_t size{0};
    std::uint64_t dropped{0};
    std::optional<std::int64_t> newest;

    void add(const Timed& reading);
    void pop() {
      first = (first + 1) % kMost;
      --size;
    }
    [[nodiscard]] const Timed& at(std::size_t k) const { return ring[(first + k) % kMost]; }
    [[nodiscard]] std::int64_t newest_ns() const { return newest.value_or(INT64_MIN); }
  };
  Queue gyro_;
  Queue accel_;
};

/// A mount_matrix of IIO, from the sensor's axes to its device's: `0, 1, 0; 1, 0, 0; 0, 0, -1`.
/// @return nullopt: not nine numbers, or not orthonormal
[[nodiscard]] std::optional<Eigen::Matrix3d> parse_mount_matrix(std::string_view text);

}  // namespace fiducap
