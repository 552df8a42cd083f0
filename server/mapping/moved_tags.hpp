#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mapping/graph/graph_solution.hpp"
#include "mapping/graph/tag_epochs.hpp"
#include "mapping/map_event.hpp"
#include "mapping/tag_map.hpp"
#include "mapping/tag_watch.hpp"

namespace fiducap {

/// What became of the tags of a map, with a graph, that left their places.
///
/// A tag is (id, place, epoch): one that is gone is quarantined, and the graph is told to bind its
/// sightings from then on to another place. When that is known, it says by how much the tag was
/// moved, or that it was not. A tag that leaves its places again and again is no landmark: it is
/// not used any more, and the places say what it may be.
class MovedTags final {
 public:
  /// @return what to say; nullopt: it is known, or was judged to be in place a moment ago
  std::optional<MapEvent> suspect(const TagSuspicion& suspicion, const MapTag& entry,
                                  std::int64_t utc_now_ns);
  /// Quarantined by `suspect`, and not found again since.
  [[nodiscard]] bool is_away(int tag_id) const;
  /// The graph does not know yet what has become of the tag.
  [[nodiscard]] bool is_outdated(const GraphTagEstimate& tag) const;

  struct Found {
    MapEvent event;
    TagState state{};  ///< Of the tag from now on.
  };
  /// @param found  where the graph has a tag that is away, by now @param all  the whole solution
  /// @return nullopt: that is not known well enough
  std::optional<Found> judge(const GraphTagEstimate& found, std::span<const GraphTagEstimate> all,
                             const MapTag& entry);
  /// Not used any more, whatever is seen of it: an operator says so.
  void set_aside(int tag_id, Instant at);
  /// Nothing is known of it: seen again, it is another tag.
  void forget(int tag_id, Instant at);
  /// For the graph, since the last call.
  [[nodiscard]] std::vector<EpochOrder> take_orders();

 private:
  struct Case {
    int epoch{0};
    bool is_away{false};
    bool is_given_up{false};
    Instant gone{};                        ///< Since then it is away.
    Instant found_until{Instant::min()};   ///< Seen in its newest place until then.
    Instant last_moved{};                  ///< Each suspicion counts as a move …
    int moves{0};                          ///< … of so many not long after each other.
    TagState before{};                     ///< What it was.
    std::string told{};                    ///< Since when, and by whom seen.
    std::vector<Pose> places{};            ///< Where it was, the newest one last.
    std::optional<Instant> disputed_at{};  ///< When it was found in place after all.
  };
  MapEvent give_up(int tag_id, Case& one);

  std::map<int, Case> cases_;
  std::vector<EpochOrder> orders_;
};

}  // namespace fiducap
