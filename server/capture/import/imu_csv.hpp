#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/import/import_source.hpp"
#include "capture/imu_sample.hpp"
#include "capture/reading_pairs.hpp"

namespace fiducap {

struct ImuColumns {
  std::size_t time{};
  std::array<std::size_t, 3> gyro{};
  std::array<std::size_t, 3> accel{};
  int time_exponent{kNotSaid};  ///< A unit of time is 10^this ns; kNotSaid: not in the header.
  double gyro_unit{0};          ///< In rad/s; 0: not in the header.
  double accel_unit{0};         ///< In m/s²; 0: not in the header.
  bool is_apple{false};         ///< iOS: the accelerometer has the opposite sign.

  static constexpr int kNotSaid = -1;
  [[nodiscard]] std::size_t last() const {
    return std::max({time, std::ranges::max(gyro), std::ranges::max(accel)});
  }
};

/// Finds the columns by many spellings: `gx`, `GyroX [deg/s]`, `angular_velocity.x`, `omega_x` …
/// @param names  seven of them, in the order time, gyro x y z, accelerometer x y z; empty: guess
/// @param units  three, e.g. `ms,deg/s,g`; empty: by the header
/// @return Error with the missing and the present columns
[[nodiscard]] Expected<ImuColumns> find_imu_columns(const std::vector<std::string>& header,
                                                    const std::string& names,
                                                    const std::string& units);

/// Of a table, by its first line: comma, semicolon, tab or blank.
[[nodiscard]] char separator_of(std::string_view line);

/// Fields of a line without blanks and quotes around them.
[[nodiscard]] std::vector<std::string> split_header(std::string_view line, char separator = ',');

using VectorReading = ReadingPairs::Timed;

struct ImuPairs {
  std::vector<ImuSample> samples;
  std::size_t alone{0};  ///< Gyro readings without an accelerometer around them: left out.
};

/// Sorts by time and removes repeated times, which phones write.
/// @return number of removed readings
std::size_t put_in_order(std::vector<VectorReading>& readings);

/// The accelerometer at the times of the gyro, linear between the readings around each
/// (ReadingPairs). @pre both in order
[[nodiscard]] ImuPairs pair_readings(const std::vector<VectorReading>& gyro,
                                     const std::vector<VectorReading>& accel);

/// A table of an IMU: its readings in SI units, and the assumptions made.
struct ImuTable {
  std::vector<ImuSample> samples;  ///< Times increase.
  FoundStream found;
  std::vector<std::string> remarks;
};

/// Reads a CSV file of an IMU; units by the header, else by the step of time and size of gravity.
/// @return Error with file and missing column
[[nodiscard]] Expected<ImuTable> read_imu_csv(const std::string& path,
                                              const ImportOptions& options);

/// A decimal number as whole nanoseconds. @param exponent  a unit is 10^this ns
[[nodiscard]] bool parse_time(std::string_view field, int exponent, std::int64_t& ns);

/// A date and time of day, `2026-11-29T10:00:00.123+01:00`, the day or the zone may be missing.
[[nodiscard]] bool parse_date(std::string_view text, std::int64_t& ns);

/// Unit of stamps by one of them: with a decimal point seconds; else the one that puts it after
/// 2001, by its digits; a small number is in nanoseconds. @return the unit is 10^this ns
[[nodiscard]] int stamp_exponent(std::string_view stamp);

/// The first line with content: the header. Error: there is none.
[[nodiscard]] Expected<std::string> first_line(const std::string& path);

}  // namespace fiducap
