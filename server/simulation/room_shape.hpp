#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

/// Walls, floor and ceiling behind the tags.
struct RoomBox {
  Eigen::Vector3d low;
  Eigen::Vector3d high;
};

/// Appearance of a room without its tags.
struct RoomLook {
  RoomBox box;
  std::string texture;  ///< See RoomConfig.
};

/// The hall, or a box around the tags of other rooms.
[[nodiscard]] RoomBox box_of(const RoomConfig& room);

[[nodiscard]] const std::vector<std::string>& room_presets();

/// q_WT of an upright tag on a wall: z along the horizontal `normal`, y up.
[[nodiscard]] Eigen::Quaterniond upright_tag(const Eigen::Vector3d& normal);

/// Corners 0..3 of a tag in W: bottom-left, bottom-right, top-right, top-left.
[[nodiscard]] std::array<Eigen::Vector3d, 4> corners_of(const RecordedTag& tag);

/// Round trip of `loop`, `pavillon` and `ring`: a rounded rectangle with a height change.
struct LoopShape {
  double length_m;
  int tags;
};
inline constexpr LoopShape kLoop{70.0, 36};
inline constexpr LoopShape kPavillon{80.0, 33};
/// The round trip of a room; `kLoop` for other presets.
[[nodiscard]] LoopShape loop_of(const RoomConfig& room);

struct LoopPoint {
  Eigen::Vector3d p;
  Eigen::Vector3d outward;  ///< Horizontal, to the right of the walker.
};
/// The point at a distance along the round trip.
[[nodiscard]] LoopPoint loop_at(const LoopShape& shape, double distance_m);

}  // namespace fiducap::simulation
