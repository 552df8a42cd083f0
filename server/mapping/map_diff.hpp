#pragma once

#include <string_view>
#include <vector>

#include "mapping/tag_map.hpp"

namespace fiducap {

/// How far one tag moved between two versions.
struct TagChange {
  int tag_id{};
  enum class Kind { kAdded, kRemoved, kMoved } kind{Kind::kMoved};
  double distance_mm{};
  double angle_deg{};
};

/// `added`, `removed`, `moved`
[[nodiscard]] std::string_view name_of(TagChange::Kind kind);

/// Added, removed and moved tags (above 1 µm or 1 µrad), sorted by id.
[[nodiscard]] std::vector<TagChange> diff(const TagMap& before, const TagMap& after);

}  // namespace fiducap
