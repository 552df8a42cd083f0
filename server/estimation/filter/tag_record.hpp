#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// A tag in a filter's state: its id and how often it was seen.
struct TagRecord {
  int tag_id{};
  double edge_m{};
  int sightings{};
  Instant first_seen{};
  Instant last_seen{};
};

/// Notes which tags of the state an update accepted.
template <class State>
void note_sightings(State& state, std::span<const TagToUse> used, const std::vector<bool>& accepted,
                    Instant at) {
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i].local < 0 || !accepted[i]) continue;
    TagRecord& tag = state.tags[static_cast<std::size_t>(used[i].local)];
    ++tag.sightings;
    tag.last_seen = at;
  }
}

/// Index of a tag in `tags`, or -1.
template <class Tags>
[[nodiscard]] int find_tag(const Tags& tags, int tag_id) {
  const auto found = std::find_if(tags.begin(), tags.end(),
                                  [&](const TagRecord& t) { return t.tag_id == tag_id; });
  return found == tags.end() ? -1 : static_cast<int>(found - tags.begin());
}

}  // namespace fiducap
