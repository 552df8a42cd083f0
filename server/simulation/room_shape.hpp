#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "simulation/simulation.hpp"

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

/// The round trip of the presets `loop`, `pavillon` and `ring`: a rounded rectangle with a height
/// change.
struct LoopShape {
  double length_m;
  int tags;
};
inline constexpr LoopShape kLoop{70.0, 36};
inline constexpr LoopShape kPavillon{80.0, 33};
/// Of a room; of any other preset: `loop`.
[[nodiscard]] LoopShape loop_of(const RoomConfig& room);

struct LoopPoint {
  Eigen::Vector3d p;
  Eigen::Vector3d outward;  ///< Horizontal, to the right of the walker.
};
/// By the distance walked.
[[nodiscard]] LoopPoint loop_at(const LoopShape& shape, double distance_m);

}  // namespace fiducap::simulation
