#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

namespace fiducap {

/// A mount_matrix of Linux's IIO, `0, 1, 0; 1, 0, 0; 0, 0, -1`: from the sensor's axes to those of
/// what it is built into. @return nullopt: not nine numbers, or not orthonormal
[[nodiscard]] std::optional<Eigen::Matrix3d> parse_mount_matrix(std::string_view text);

}  // namespace fiducap
