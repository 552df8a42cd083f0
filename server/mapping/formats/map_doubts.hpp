#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mapping/tag_map.hpp"

namespace fiducap {

/// What cannot be in metres: an edge beyond 10 m or below 1 mm, a place beyond 1000 km.
/// @return e.g. `edge is 160 m: …`; nullopt when it can
[[nodiscard]] std::optional<std::string> unit_fault_in(const KnownTag& tag);
[[nodiscard]] std::optional<std::string> unit_fault_of_edge(double edge_m);
[[nodiscard]] std::optional<std::string> unit_fault_of_place(const Eigen::Vector3d& p_WT);

/// What makes one doubt that a map of another program was read in its own convention: all tags
/// below the floor, all upside down, far from the origin. One sentence each; empty for a usual map.
[[nodiscard]] std::vector<std::string> doubts_about(const TagMap& map);

/// `tags 3, 4 and 7`; after ten of them only how many more.
[[nodiscard]] std::string tags_text(const std::vector<int>& ids);

}  // namespace fiducap
