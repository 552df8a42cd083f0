#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// A tag in a filter's state: who it is and how it fared.
struct TagRecord {
  static constexpr int kContradictions = 3;  ///< Fewer may be a bad image.

  int tag_id{};
  double edge_m{};
  int sightings{};
  Instant first_seen{};
  Instant last_seen{};
  int rejected_in_row{};  ///< By images that accepted other tags.
  int rejected_alone{};   ///< By images that accepted none, since one last did.

  /// It contradicts, or the filter is wrong.
  [[nodiscard]] bool is_doubted() const { return rejected_alone >= kContradictions; }
};

/// Notes which tags an update accepted. A tag that keeps contradicting the others is gone from its
/// place: it leaves the state, and may join again like a new one. An update that accepts none
/// blames no tag yet: the filter may be wrong itself. If it was one tag all the time, and then
/// another fits, that one is to blame.
/// @param state  has `tags` (of TagRecord) and `remove_tag(i)`
/// @return ids of the tags that left
template <class State>
[[nodiscard]] std::vector<int> keep_score(State& state, std::span<const TagToUse> used,
                                          const std::vector<bool>& accepted, Instant at) {
  constexpr int kRejectionsToDrop = 10;  // contradictions in a row before a tag is given up
  const bool any = std::find(accepted.begin(), accepted.end(), true) != accepted.end();
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i].local < 0) continue;
    TagRecord& tag = state.tags[static_cast<std::size_t>(used[i].local)];
    if (accepted[i]) {
      ++tag.sightings;
      tag.last_seen = at;
      tag.rejected_in_row = tag.rejected_alone = 0;
    } else {
      ++(any ? tag.rejected_in_row : tag.rejected_alone);
    }
  }
  if (!any) return {};
  const auto doubted = std::count_if(state.tags.begin(), state.tags.end(),
                                     [](const TagRecord& tag) { return tag.is_doubted(); });
  std::vector<int> left;
  for (std::size_t i = state.tags.size(); i-- > 0;) {
    TagRecord& tag = state.tags[i];
    const bool is_gone = tag.rejected_in_row >= kRejectionsToDrop ||
                         (doubted == 1 && tag.rejected_alone >= kRejectionsToDrop);
    tag.rejected_alone = 0;
    if (!is_gone) continue;
    left.push_back(tag.tag_id);
    state.remove_tag(i);
  }
  return left;
}

/// What they were blamed for was something else.
template <class Tags>
void forgive(Tags& tags) {
  for (TagRecord& tag : tags) tag.rejected_in_row = tag.rejected_alone = 0;
}

/// Index of a tag in `tags`, or -1.
template <class Tags>
[[nodiscard]] int find_tag(const Tags& tags, int tag_id) {
  const auto found = std::find_if(tags.begin(), tags.end(),
                                  [&](const TagRecord& t) { return t.tag_id == tag_id; });
  return found == tags.end() ? -1 : static_cast<int>(found - tags.begin());
}

}  // namespace fiducap
