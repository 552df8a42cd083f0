#include "estimation/robocentric/tag_score.hpp"

#include <algorithm>

namespace fiducap::robocentric {

namespace {

// Contradictions in a row before a tag is given up.
constexpr int kRejectionsToDrop = 10;

}  // namespace

std::vector<int> keep_score(FilterState& state, std::span<const TagToUse> used, const std::vector<bool>& accepted,
                            Instant at) {
  const bool any = std::find(accepted.begin(), accepted.end(), true) != accepted.end();
  for (std::size_t i = 0; any && i < used.size(); ++i) {
    if (used[i].local < 0) continue;
    LocalTag& tag = state.tags[static_cast<std::size_t>(used[i].local)];
    if (accepted[i]) {
      ++tag.sightings;
      tag.last_seen = at;
      tag.rejected_in_row = 0;
    } else {
      ++tag.rejected_in_row;
    }
  }
  std::vector<int> left;
  for (std::size_t i = state.tags.size(); i-- > 0;) {
    if (state.tags[i].rejected_in_row < kRejectionsToDrop) continue;
    left.push_back(state.tags[i].tag_id);
    state.remove_tag(i);
  }
  return left;
}

}  // namespace fiducap::robocentric
