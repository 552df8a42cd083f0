#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Where the middle of a tag is in the room, as somebody has measured it.
struct MeasuredPlace {
  int tag_id{};
  Eigen::Vector3d p_RT{Eigen::Vector3d::Zero()};
};

/// Where W lies in the room.
struct MapAlignment {
  struct Residual {
    int tag_id{};
    Eigen::Vector3d off_m;  ///< Measured less aligned, room axes.
  };
  Pose X_RW;
  std::vector<Residual> residuals;  ///< In the order of the places.
};

/// Lays the map over places that were measured in the room: yaw and shift, least squares. What is
/// up both know by gravity, and scale neither may change.
/// @param most_off_m  what a measurement may be off
/// @return Error naming the tag when a place contradicts the others or is not usable: less than
/// three tags, one twice, not in the map, all above each other; and when axes or units cannot be
/// ours (mirrored, millimetres)
[[nodiscard]] Expected<MapAlignment> align(const TagMap& map, std::span<const MeasuredPlace> places,
                                           double most_off_m);

/// How far the middles of two tags are apart.
struct TagDistance {
  double distance_m{};
  double sigma_m{};     ///< With what their errors share, where the map says so.
  bool is_tied{false};  ///< It does.
};

/// @return Error naming the tag that the map does not have, or does not use
[[nodiscard]] Expected<TagDistance> distance_between(const TagMap& map, int first_id,
                                                     int second_id);

}  // namespace fiducap
