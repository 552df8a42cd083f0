#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// What the map knows of a tag, or nullptr.
[[nodiscard]] inline const KnownTag* find_known(std::span<const KnownTag> known, int tag_id) {
  const auto found = std::find_if(known.begin(), known.end(),
                                  [&](const KnownTag& k) { return k.tag_id == tag_id; });
  return found == known.end() ? nullptr : &*found;
}

/// The tags of one image. Kept between images, for its memory.
struct ImageTags {
  std::vector<TagToUse> usable;  ///< They correct the state …
  std::vector<TagToUse> fresh;   ///< … and these may join it.
  std::vector<bool> accepted;    ///< Per usable one, by the last update.

  /// @param is_anchored  the map's places mean something to this filter
  template <class State>
  void sort(const TagObservations& seen, std::span<const KnownTag> known, const State& state,
            bool is_anchored) {
    usable.clear();
    fresh.clear();
    for (const TagObservation& tag : seen.tags) {
      const TagToUse use{&tag, state.find(tag.tag_id), find_known(known, tag.tag_id)};
      const bool is_usable = use.local >= 0 || (use.known != nullptr && is_anchored);
      (is_usable ? usable : fresh).push_back(use);
    }
  }
};

}  // namespace fiducap
