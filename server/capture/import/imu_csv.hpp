#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/import/import_source.hpp"
#include "capture/imu_sample.hpp"

namespace fiducap {

/// A table of an IMU: its readings in SI units, and what was assumed to get them.
struct ImuTable {
  std::vector<ImuSample> samples;  ///< Times increase.
  FoundStream found;
  std::vector<std::string> remarks;
};

/// Reads a CSV file of an IMU. Columns are found by their header (see find_imu_columns), units by
/// the header, else by the numbers: the step of time, the size of gravity.
/// @return Error naming file and missing column
[[nodiscard]] Expected<ImuTable> read_imu_csv(const std::string& path,
                                              const ImportOptions& options);

/// Digits with or without a point as whole nanoseconds. @param exponent  a unit is 10^this ns
[[nodiscard]] bool parse_time(std::string_view field, int exponent, std::int64_t& ns);

/// The first line with content: where names of columns stand. Empty: the file has none.
[[nodiscard]] Expected<std::string> first_line(const std::string& path);

}  // namespace fiducap
