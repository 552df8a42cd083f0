#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "capture/imu_sample.hpp"

namespace fiducap {

/// The gyro's rates summed over time, so that the turn of any short span can be asked for at once.
///
/// A turn is the integral of the rate in body axes: over a third of a second it is the rotation
/// vector to first order, and what is left out is far below the noise of a tag's attitude. Keeps
/// five seconds; forgets them when readings pause, go backwards or are clipped.
class GyroIntegral final {
 public:
  /// @param range_rad_s  where readings end; 0: not known
  explicit GyroIntegral(double range_rad_s = 0) : range_rad_s_(range_rad_s) {}

  void add(const ImuSample& imu);
  /// From `from` to `to`. nullopt: not (or no longer, or not yet) known.
  [[nodiscard]] std::optional<Eigen::Vector3d> turn(Instant from, Instant to) const;
  /// Known without gaps from the first to the second; both equal: nothing is known.
  [[nodiscard]] Instant begin() const { return Instant{begin_ * kStep}; }
  [[nodiscard]] Instant end() const { return Instant{(end_ - 1) * kStep}; }
  [[nodiscard]] bool covers(Instant from, Instant to) const {
    return end_ > begin_ && from >= begin() && to <= end();
  }

 private:
  static constexpr Duration kStep = std::chrono::milliseconds(5);
  static constexpr std::int64_t kSteps = 1024;

  void begin_anew();
  [[nodiscard]] Eigen::Vector3d at(Instant t) const;
  [[nodiscard]] Eigen::Vector3d& sum(std::int64_t step) {
    return sums_[static_cast<std::size_t>(step & (kSteps - 1))];
  }
  [[nodiscard]] const Eigen::Vector3d& sum(std::int64_t step) const {
    return sums_[static_cast<std::size_t>(step & (kSteps - 1))];
  }

  double range_rad_s_;
  std::array<Eigen::Vector3d, kSteps> sums_{};
  std::int64_t begin_{0};  ///< First step that is known …
  std::int64_t end_{0};    ///< … and the one after the last.
  std::optional<ImuSample> last_;
  Eigen::Vector3d last_sum_{Eigen::Vector3d::Zero()};
};

}  // namespace fiducap
