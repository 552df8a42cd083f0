#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

/// `<body>.covariance.csv`, one line per pose: nanoseconds, then the upper triangle row by row
/// (position and rotation vector, both in W axes); numbers read back as the same doubles.
[[nodiscard]] std::string to_covariance_csv(std::span<const StampedCovariance> covariances);

/// Comments (`#`) and empty lines are skipped.
/// @return in the file's order; Error with the line number for anything else, also for time that
/// does not increase and variances that are none.
[[nodiscard]] Expected<std::vector<StampedCovariance>> covariances_from_csv(
    std::string_view text, const std::string& context);

}  // namespace fiducap
