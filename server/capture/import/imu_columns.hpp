#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

/// Where a table has what an IMU says, and in which units.
struct ImuColumns {
  std::size_t time{};
  std::array<std::size_t, 3> gyro{};
  std::array<std::size_t, 3> accel{};
  int time_exponent{kNotSaid};  ///< A unit of time is 10^this ns; kNotSaid: the header is silent.
  double gyro_unit{0};          ///< In rad/s; 0: the header is silent.
  double accel_unit{0};         ///< In m/s²; 0: the header is silent.

  static constexpr int kNotSaid = -1;
  [[nodiscard]] std::size_t last() const;
};

inline constexpr double kStandardGravity_m_s2 = 9.80665;

/// Finds the columns by their names, whatever the spelling: `gx`, `GyroX [deg/s]`,
/// `angular_velocity.x`, `w_RS_S_x [rad s^-1]`, `omega_x` …
/// @param names  seven of them, in the order time, gyro x y z, accelerometer x y z; empty: guess
/// @param units  three, e.g. `ms,deg/s,g`; empty: as the header says
/// @return Error naming what was not found, and what is there
[[nodiscard]] Expected<ImuColumns> find_imu_columns(const std::vector<std::string>& header,
                                                    const std::string& names,
                                                    const std::string& units);

/// A line of a table, cut at its commas, without blanks and quotes around the parts.
[[nodiscard]] std::vector<std::string> split_header(std::string_view line);

}  // namespace fiducap
