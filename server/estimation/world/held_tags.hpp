#pragma once

#include <span>
#include <vector>

#include "detection/tag_observation.hpp"
#include "estimation/known_map.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Tags of the map in a filter's state: used and not corrected (Schmidt). Those in view are held,
/// and a few that were seen last.
class HeldTags final {
 public:
  /// Takes over what the map says of tags in view and of those held.
  /// @param whole  what their errors share, or nullptr: each stands alone
  void follow(FilterState& state, const TagObservations& seen, std::span<const KnownTag> known,
              const KnownMap* whole, bool is_anchored);

 private:
  void forget(FilterState& state, const TagObservations& seen);

  std::vector<std::size_t> out_of_view_;  ///< Memory, kept between images.
};

/// Nothing when it is there already, or exact: exact tags need no state.
void hold_one(FilterState& state, const KnownTag& tag, const KnownMap* whole, Instant at);

}  // namespace fiducap::world
