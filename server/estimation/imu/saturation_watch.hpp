#pragma once

#include <array>
#include <cstddef>

#include "capture/imu_sample.hpp"

namespace fiducap {

/// Sensors of a unit whose reading is not to be believed.
struct Saturated {
  bool gyro{false};
  bool accel{false};
};

/// A reading and whether to believe it.
struct JudgedReading {
  ImuSample imu;
  Saturated saturated;
};

/// White rate noise that a gyro at the end of its range, or a hole in the stream, is bridged with.
inline constexpr double kBlindRate_rad_s_rtHz = 1.0;

/// Finds readings that ran into the end of the sensor's range.
///
/// Either the range is known (ImuNoise), or the signal shows it: an axis that used to change from
/// reading to reading stands at exactly one number, longer than chance allows, while another axis
/// goes on. (A coarse sensor at rest repeats numbers, too: how often it did before tells how long a
/// run may be. A unit that reports all axes unchanged is at rest or dead.)
class SaturationWatch final {
 public:
  explicit SaturationWatch(const ImuNoise& unit) : unit_(unit) {}

  struct Finding {
    Saturated now;
    std::size_t gyro_since{0};   ///< So many readings before this one stood at the end as well …
    std::size_t accel_since{0};  ///< … only said when it is first noticed.
  };
  [[nodiscard]] Finding look_at(const ImuSample& imu);

 private:
  struct Axis {
    double last{0};
    int changes{0};       ///< Bounded count of readings that differed from the one before.
    double repeats{0.5};  ///< Share of readings that did not, fading; without the present run.
    int run{0};           ///< Readings that repeat the one before, up to now.
    bool is_flat{false};
  };

  /// @return readings before this one that turn out to be at the end; 0 when nothing is new
  static std::size_t judge(Axis& axis, double value, bool others_move);
  [[nodiscard]] static bool is_long(const Axis& axis);

  ImuNoise unit_;
  std::array<Axis, 6> axes_{};
};

}  // namespace fiducap
