#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "base/stamped_pose.hpp"

namespace fiducap {

/// One line per pose, `t tx ty tz qx qy qz qw`: t in seconds with nine decimals (made from the
/// integer nanoseconds, nothing is rounded), the rest so that reading gives the same doubles back.
[[nodiscard]] std::string to_tum(std::span<const StampedPose> poses);

/// Comments (`#`) and empty lines are skipped; attitudes are normalised.
/// @return in the file's order; Error with the line number for anything else, also for time that
/// does not increase.
[[nodiscard]] Expected<std::vector<StampedPose>> tum_from(std::string_view text,
                                                          const std::string& context);

}  // namespace fiducap
