#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/map_view.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// A tag is not in its place any more.
struct TagDisplacement {
  int tag_id{};
  std::optional<Instant> fitted_at{};  ///< When a body last found it there; nullopt: none did.
  Instant first_report_at{};
  Instant at{};      ///< Of the report that decided.
  std::set<int> by;  ///< Bodies.
};

/// Detects tags that have left their places, from the reports of all bodies.
///
/// A body's filter rejects a tag that contradicts image after image which other tags fit. That
/// alone decides nothing: a body that is lost rejects one tag after the other. Such a body agrees
/// with few tags of the *map* and contradicts several. So a report counts only when its body has
/// just found two other tags of the map in their places, and three times as many as it contradicts
/// when those are several; otherwise all reports of the body are discarded. Three reports decide. A
/// body that finds the tag in its place, together with another one, clears them: a tag has not
/// moved for one body only.
class TagWatch final {
 public:
  /// @param fitting  tags of one image that are where the map has them
  /// @param contradicted  tags of the map that the body's filter has rejected
  /// @return tags that are displaced now; their reports are cleared
  [[nodiscard]] std::vector<TagDisplacement> report(int body_id, Instant at,
                                                    std::span<const int> fitting,
                                                    std::span<const int> contradicted);
  /// The tag has another place: reports about the old one are void.
  void forget(int tag_id);

 private:
  struct Report {
    int body_id{};
    Instant at{};
  };
  struct OfTag {
    std::optional<Instant> fitted_at{};        ///< Together with another tag …
    std::optional<Instant> fitted_alone_at{};  ///< … or alone, when every pose of the body fits.
    std::vector<Report> reports{};
  };
  struct OfBody {
    std::map<int, Instant> fitted{};  ///< By tag.
    std::map<int, Instant> contradicted{};
  };
  [[nodiscard]] static bool is_reliable(OfBody& body, Instant at);
  [[nodiscard]] std::optional<TagDisplacement> decide(int tag_id, Instant at);

  std::map<int, OfTag> tags_;
  std::map<int, OfBody> bodies_;
};

/// Tags of a map with a graph that have left their places.
///
/// A place of a tag is (id, epoch): a displaced tag is quarantined, and the graph binds its later
/// sightings to another place. When that is known, an event reports by how much the tag was moved,
/// or that it was not. A tag that leaves its places repeatedly is excluded, with the likely cause.
class MovedTags final {
 public:
  /// @return the event; nullopt: the tag is excluded, or was found in place a moment ago
  std::optional<MapEvent> displace(const TagDisplacement& displacement, const MapTag& entry,
                                   std::int64_t utc_now_ns);
  /// Displaced, and not found again since.
  [[nodiscard]] bool is_away(int tag_id) const;
  /// The estimate is older than the tag's newest place.
  [[nodiscard]] bool is_outdated(const GraphTagEstimate& tag) const;

  struct Found {
    MapEvent event;
    TagState state{};  ///< Of the tag from now on.
  };
  /// @param found  estimate of a tag that is away @param all  the whole solution
  /// @return nullopt: the new place is not known well enough
  std::optional<Found> locate(const GraphTagEstimate& found, std::span<const GraphTagEstimate> all,
                              const MapTag& entry);
  /// By the operator: the tag is not used any more.
  void exclude(int tag_id, Instant at);
  /// By the operator: seen again, it is a new tag.
  void forget(int tag_id, Instant at);
  /// For the graph, since the last call.
  [[nodiscard]] std::vector<EpochOrder> take_orders();

 private:
  struct History {
    int epoch{0};
    bool is_away{false};
    bool is_excluded{false};
    Instant gone{};                       ///< When it left its place.
    Instant found_until{Instant::min()};  ///< Last sighting in its newest place.
    Instant last_moved{};
    int moves{0};                      ///< Displacements at most ten minutes apart.
    TagState before{};                 ///< State before the displacement.
    std::string seen{};                ///< Text: when it left, and seen by which bodies.
    std::vector<Pose> places{};        ///< Former places, the newest one last.
    std::optional<Instant> kept_at{};  ///< When it was found in place after all.
  };
  MapEvent exclude(int tag_id, History& tag);

  std::map<int, History> tags_;
  std::vector<EpochOrder> orders_;
};

}  // namespace fiducap
