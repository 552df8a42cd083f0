#pragma once

#include <array>
#include <optional>

namespace fiducap {

/// Gray across a side, mean over many places along it: evenly from one module inside (first) to one
/// module outside of where the side is thought to be.
using SideProfile = std::array<double, 25>;

/// Modules.
struct SmearedSide {
  double off{};  ///< Outwards.
  double smear{};
};

/// The grays of a tag's border and of its quiet zone.
struct TagLevels {
  double black{};
  double white{};
};

/// Where the edge between black border and quiet zone is in a profile that motion, or a narrow
/// module, has smeared so far that what lies beyond them reaches it.
///
/// Bits, border, quiet zone and wall are four grays whose edges are a module apart; smeared over a
/// length, they add up to the profile. Length, place and grays are fitted: the steepest place is
/// not where the edge is when bits and wall are not equally unlike their neighbours.
/// @param smear   where to begin, modules
/// @param levels  where they are known: else grays between them can put the edge elsewhere
/// @return nullopt where such a picture does not explain the profile
[[nodiscard]] std::optional<SmearedSide> find_smeared_side(
    const SideProfile& gray, double smear, const std::optional<TagLevels>& levels = std::nullopt);

}  // namespace fiducap
