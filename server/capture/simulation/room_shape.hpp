#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "capture/simulation/simulation.hpp"

namespace fiducap::simulation {

/// The walls, floor and ceiling that a camera sees behind the tags.
struct RoomBox {
  Eigen::Vector3d low;
  Eigen::Vector3d high;
};

/// A room as a camera sees it without its tags.
struct RoomLook {
  RoomBox box;
  std::string texture;  ///< See RoomConfig.
};

/// The hall itself, or what surrounds the tags of the other rooms.
[[nodiscard]] RoomBox box_of(const RoomConfig& room);

[[nodiscard]] const std::vector<std::string>& room_presets();

/// Axes T of a tag upright on a wall: z along the horizontal `normal`, y up.
[[nodiscard]] Eigen::Quaterniond upright_tag(const Eigen::Vector3d& normal);

/// Corners 0..3 of a tag in W: bottom-left, bottom-right, top-right, top-left.
[[nodiscard]] std::array<Eigen::Vector3d, 4> corners_of(const RecordedTag& tag);

/// The round trip of preset `loop`: a rounded rectangle with a height change, by the distance
/// walked.
struct LoopPoint {
  Eigen::Vector3d p;
  Eigen::Vector3d outward;  ///< Horizontal, to the right of the walker.
};
inline constexpr double kLoopLength_m = 70.0;
[[nodiscard]] LoopPoint loop_at(double distance_m);

}  // namespace fiducap::simulation
