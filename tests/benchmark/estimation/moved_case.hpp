#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "estimation/options.hpp"

namespace fiducap::bench {

/// Three robots in a room one of whose tags does not stay, is there twice, or is printed wrongly.
struct MovedCase {
  std::vector<EstimationData> data;
  std::optional<TagMap> start;  ///< Of the day before, when all was well; frozen since.
  int tag_id{-1};               ///< -1: nothing is wrong.
  double at_s{};                ///< … from then on.
  std::vector<Pose> places;     ///< Of the tag, room axes, the one of before first.
  /// Of each robot: images that show the tag otherwise than it was before, or is configured.
  std::vector<std::set<Instant>> elsewhere;
  /// It is there twice from the start: whoever has seen one print only knows of nothing.
  bool is_twice{false};
};

/// @param name  WHAT[-WORLD][-frozen]: metres by which the tag is moved, `door`, `size`,
/// `duplicate` (prints that are never in one image) or `duplicate-near`, or `clean`; on the ring,
/// if no other world is named
[[nodiscard]] MovedCase make_moved_case(const EstimationOptions& options, const std::string& name,
                                        std::uint64_t seed);

}  // namespace fiducap::bench
