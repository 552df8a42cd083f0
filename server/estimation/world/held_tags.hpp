#pragma once

#include <cstdint>
#include <optional>
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
  /// The map has another revision than the one that was last taken over.
  [[nodiscard]] bool has_news(const KnownMap& map) const { return revision_ != map.revision; }
  /// See exchange(); once for each revision of the map.
  std::optional<Pose> take_over(FilterState& state, const KnownMap& map, bool level);
  /// Takes over what the map says of tags in view and of those held.
  /// @param whole  what their errors share, or nullptr: each stands alone
  void follow(FilterState& state, const TagObservations& seen, std::span<const KnownTag> known,
              const KnownMap* whole, bool is_anchored);

 private:
  void forget(FilterState& state, const TagObservations& seen);

  std::optional<std::uint64_t> revision_;  ///< Of the map that was last taken over.
  std::vector<std::size_t> out_of_view_;   ///< Memory, kept between images.
};

/// Nothing when it is there already, or exact: exact tags need no state.
void hold_one(FilterState& state, const KnownTag& tag, const KnownMap* whole, Instant at);

}  // namespace fiducap::world
