#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

/// `<body>.tum`, one line per pose: `t tx ty tz qx qy qz qw`, t in seconds with nine decimals, made
/// from the integer nanoseconds without rounding. Numbers read back as the same doubles.
[[nodiscard]] std::string to_tum(std::span<const StampedPose> poses);

/// Comments (`#`) and empty lines are skipped; attitudes are normalised.
/// @return in the file's order; Error with the line number for anything else, also for time that
/// does not increase.
[[nodiscard]] Expected<std::vector<StampedPose>> tum_from(std::string_view text,
                                                          const std::string& context);

/// `<body>.covariance.csv`, one line per pose: nanoseconds, then the upper triangle row by row
/// (position and rotation vector, both in W axes). Numbers read back as the same doubles.
[[nodiscard]] std::string to_covariance_csv(std::span<const StampedCovariance> covariances);

/// Comments (`#`) and empty lines are skipped.
/// @return in the file's order; Error with the line number for anything else, also for time that
/// does not increase and for negative variances.
[[nodiscard]] Expected<std::vector<StampedCovariance>> covariances_from_csv(
    std::string_view text, const std::string& context);

}  // namespace fiducap
