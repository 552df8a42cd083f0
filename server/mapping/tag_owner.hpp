#pragma once

#include <map>
#include <optional>

#include "base/time.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Whose business a tag of the map is, where no graph says where tags are.
struct TagOwner {
  std::optional<int> body_id{};  ///< nullopt: a local tag of the starting map.
  Instant last_seen{};
  std::optional<Instant> still_since{};  ///< When the published place last changed, by the owner.
  std::optional<Instant> quarantined_at{};
  TagState before{TagState::kLocal};     ///< What it was before the quarantine.
  std::optional<Instant> disputed_at{};  ///< Contradicted, but not moved: stays where it is.
};

/// Of every tag that may still move in a session that starts with this map.
[[nodiscard]] inline std::map<int, TagOwner> owners_of(const TagMap& start) {
  std::map<int, TagOwner> owners;
  for (const MapTag& entry : start.tags) {
    if (entry.state == TagState::kLocal) owners[entry.tag.tag_id] = {};
    if (entry.state == TagState::kQuarantined)
      owners[entry.tag.tag_id] = {.quarantined_at = Instant::min()};
  }
  return owners;
}

/// Some tag says where the workspace is.
[[nodiscard]] bool has_places(const TagMap& map);

}  // namespace fiducap
