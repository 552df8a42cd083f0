#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "base/pose.hpp"

namespace fiducap {

/// What is up by tags that lie flat, face up. Where three or more lie well apart their places say
/// it better than their faces: paper bends.
/// @param X_AT  any axes that stand still
/// @return in those axes; nullopt: no tag, or their faces look opposite ways
[[nodiscard]] std::optional<Eigen::Vector3d> up_by_floor(std::span<const Pose> X_AT);

/// A tag's attitude in upright axes whose heading is the tag's: its x axis points along x, as far
/// as it is level (a steep one leaves that to the next axis).
[[nodiscard]] Eigen::Quaterniond upright_attitude(const Eigen::Quaterniond& q_AT,
                                                  const Eigen::Vector3d& up_A);

}  // namespace fiducap
