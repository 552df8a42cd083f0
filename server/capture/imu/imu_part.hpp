#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "capture/imu_sample.hpp"

namespace fiducap {

/// Starting values for an inertial unit of which nothing but the part is known, from data sheets;
/// imu_part.cpp
/// says which and how. Measured noise (`fiducap calibrate imu`) is better.
/// @param part  as in `part_names`, whatever its case; `_`, blanks and `-` are the same
/// @return nullopt: not in the table
[[nodiscard]] std::optional<ImuNoise> noise_of_part(std::string_view part, double rate_hz);

/// Of chips, and of cameras and autopilots that carry them; in the order of the table.
[[nodiscard]] std::vector<std::string_view> part_names();

}  // namespace fiducap
