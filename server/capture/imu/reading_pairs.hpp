#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

namespace fiducap {

/// Gyro and accelerometer of two devices, each with times of its own: the accelerometer is brought
/// to the gyro's times by straight lines between its readings. A gyro reading waits for the next
/// one of the accelerometer. Bounded: of more than 256 that wait the oldest are dropped, counted.
class ReadingPairs final {
 public:
  struct Timed {
    std::int64_t stamp_ns{};
    Eigen::Vector3d value{Eigen::Vector3d::Zero()};
  };
  struct Pair {
    std::int64_t stamp_ns{};
    Eigen::Vector3d w{Eigen::Vector3d::Zero()};
    Eigen::Vector3d f{Eigen::Vector3d::Zero()};
  };

  /// Of one device times increase; what does not is dropped.
  void add_gyro(const Timed& reading) { gyro_.add(reading); }
  void add_accel(const Timed& reading) { accel_.add(reading); }
  [[nodiscard]] std::optional<Pair> take();

  /// Whose newest reading is older: which one is to be read next.
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
    void pop();
    [[nodiscard]] const Timed& at(std::size_t k) const { return ring[(first + k) % kMost]; }
    [[nodiscard]] std::int64_t newest_ns() const { return newest.value_or(INT64_MIN); }
  };
  Queue gyro_;
  Queue accel_;
};

}  // namespace fiducap
