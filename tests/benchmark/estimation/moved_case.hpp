#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "estimation/options.hpp"

namespace fiducap::bench {

/// Three robots in a room with one tag that moves, exists twice, or is printed wrongly.
struct MovedCase {
  std::vector<EstimationData> data;
  std::optional<TagMap> start;  ///< Of the day before, without the fault; frozen since.
  int tag_id{-1};               ///< -1: nothing is wrong.
  double at_s{};                ///< … from then on.
  std::vector<Pose> places;     ///< Of the tag, room axes, the first one without the fault.
  /// Of each robot: images that show the tag with the fault.
  std::vector<std::set<Instant>> elsewhere;
  /// It exists twice from the start: one print alone shows no fault.
  bool is_twice{false};
};

/// @param name  WHAT[-WORLD][-frozen]: metres by which the tag is moved, `door`, `size`,
/// `duplicate` (prints that are never in one image) or `duplicate-near`, or `clean`; on the ring,
/// if no other world is named
[[nodiscard]] MovedCase make_moved_case(const EstimationOptions& options, const std::string& name,
                                        std::uint64_t seed);

}  // namespace fiducap::bench
