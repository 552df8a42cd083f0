#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/map_view.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The same place in another estimate, whatever their covariances.
[[nodiscard]] bool is_near(const Pose& a, const Pose& b);
/// Two estimates of a tag agree: they are near each other, and differ by no more than their errors.
[[nodiscard]] bool is_same_place(const KnownTag& a, const KnownTag& b);
/// An estimate has enough sightings over enough time: a door stands still for a moment.
[[nodiscard]] bool is_confirmed(int sightings, Duration seen_for);

/// A tag of the map that is elsewhere for a body.
struct Contradiction {
  KnownTag in_map;
  std::optional<TagBelief> own{};  ///< The body's own estimate; nullopt: it has none yet.
};

/// A tag is not in its place any more.
struct TagDisplacement {
  int tag_id{};
  std::optional<Instant> fitted_at{};  ///< When a body last found it there; nullopt: none has.
  Instant at{};                        ///< Of the report that decided.
  int body_id{};
};

/// Detects tags that have left their places, from the reports of all bodies: by the odds of "the
/// tag was moved" against "the body is lost", which displaces all tags equally.
///
/// A tag moves, and a body gets lost, about once an hour: in the last ten seconds with a
/// probability p of 1 in 360. While a body contradicts G tags that one displacement of itself
/// explains, and finds F others in their places,
///
///     p(moved) = p^G        p(lost) = p_lost p^F
///
/// since F tags in place for a lost body would have moved with it. p_lost = p for a body that had
/// found two tags in place before, else 1. So the tag was moved if F + [found two before] > G: odds
/// of 360 to 1 or more. Two swapped prints of three are two displacements (G = 1 each), and the
/// third tag is enough.
///
/// The tag must also differ from its place by more than both covariances, in an own estimate of the
/// body with enough sightings. A body that finds the tag in its place, together with another one,
/// voids all reports: a tag has not moved for one body only.
class TagWatch final {
 public:
  /// @param fitting  tags of one image that are where the map has them
  /// @param contradicted  tags of the map that the body has elsewhere
  /// @return tags that are displaced now
  [[nodiscard]] std::vector<TagDisplacement> report(int body_id, Instant at,
                                                    std::span<const int> fitting,
                                                    std::span<const Contradiction> contradicted);
  /// The tag has another place: reports about the old one are void.
  void forget(int tag_id);

 private:
  struct OfTag {
    std::optional<Instant> fitted_at{};        ///< Together with another tag …
    std::optional<Instant> fitted_alone_at{};  ///< … or alone, when every pose of the body fits.
  };
  struct OfBody {
    struct Contradicted {
      Instant since{};
      Instant at{};               ///< Of the last report.
      bool had_found_two{false};  ///< Tags in place, before.
      Contradiction how;
    };
    std::map<int, Instant> fitted{};  ///< By tag.
    std::map<int, Contradicted> contradicted{};
  };
  void note_fitting(OfBody& body, Instant at, std::span<const int> fitting);
  [[nodiscard]] static int displaced_equally(const OfBody& body, const Contradiction& one);
  /// The tag was moved; otherwise it is not known well enough, or the body is lost.
  [[nodiscard]] bool is_moved(const OfBody& body, int tag_id) const;

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
