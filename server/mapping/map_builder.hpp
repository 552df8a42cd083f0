#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/map_config.hpp"
#include "mapping/map_event.hpp"
#include "mapping/map_news.hpp"
#include "mapping/map_view.hpp"
#include "mapping/moved_tags.hpp"
#include "mapping/tag_map.hpp"
#include "mapping/tag_owner.hpp"
#include "mapping/tag_watch.hpp"

namespace fiducap {

/// Joins the tag beliefs of all bodies into the one shared map, and owns the workspace.
///
/// The workspace is defined once: by the reference tag or, when none is named, by the first body
/// that anchors itself while the map is empty. All others wait for a tag of the map. A body asks
/// for a `view` before each image and contributes after it; in between it alone may define the
/// workspace.
///
/// Surveyed tags stay as they are. With a graph (`refine_period_s`) it says where all others are
/// (adopt), and TagWatch finds out which have left their places. Without one a tag belongs to the
/// body that knows it best: its belief is copied, never averaged with others' (they share known
/// tags, so they are not independent); another body takes it over when its position variance is
/// 30 % smaller. A tag that a body contradicts is quarantined until one has learned it anew; found
/// less than 0.1 m and 0.1 rad away it is disputed: it stays, and contradictions count again a
/// minute later. Beliefs do not keep ties between tags (TagMap::known) true: they are dropped.
///
/// A snapshot is published when a tag is new, moved by 0.1 mm or 0.01°, changed its state, or its
/// 1-sigma changed by a tenth, each against the published map; sightings and times travel along
/// with the next one. The snapshot keeps the version it came from; its `hash` is empty as soon as
/// it differs from that version. Thread-safe; reading a snapshot never waits for a copy of the
/// map.
class MapBuilder final {
 public:
  MapBuilder(const MapConfig& config, TagMap start);

  /// For the next image of a body.
  [[nodiscard]] MapView view(int body_id);
  /// @param utc_now_ns  for first/last seen, and the time of creation of what is published
  /// @return how many contributions came before this one
  std::uint64_t absorb(const MapContribution& contribution, std::int64_t utc_now_ns);
  /// What has come since the last call, in order, and how many contributions have come.
  struct Waiting {
    struct OfBody {
      int body_id{};
      std::shared_ptr<const MotionSegment> segment;
    };
    std::vector<OfBody> segments;
    /// The map was replaced: whatever was taken before counts no more. Comes before the moves.
    std::shared_ptr<const TagMap> begin_anew;
    std::vector<EpochOrder> moves;  ///< Come before the segments.
    std::uint64_t contributions{};
  };
  [[nodiscard]] Waiting take_segments();
  /// What the graph makes of all segments so far: from now on it says where its tags are, and
  /// beliefs are not listened to any more.
  /// @return how many contributions have come before
  std::uint64_t adopt(GraphSolution solution, std::int64_t utc_now_ns);
  /// Nothing more comes from this body; what it reserved is free.
  void release(int body_id);
  [[nodiscard]] std::shared_ptr<const TagMap> snapshot() const;
  /// The snapshot with its revision; reserves nothing.
  [[nodiscard]] MapView published() const;
  /// @return true when the map differs from what was last marked as stored.
  [[nodiscard]] bool changed() const;
  /// `stored` came back from MapStore::commit(*snapshot): version numbers move on, content stays.
  void mark_stored(const TagMap& stored);
  /// What happened since the last call, oldest first; the newest 256 are kept.
  [[nodiscard]] std::vector<MapEvent> take_events();
  void set_mode(MapMode mode);
  [[nodiscard]] MapMode mode() const;

  // What an operator does by hand: map_by_hand.cpp. Errors are for him to read.

  /// A map may be put in this one's place. @return Error when it is frozen, or `map` has no place
  [[nodiscard]] Expected<void> may_begin_anew(const TagMap& map) const;
  /// Serves another map from now on, as if the server had begun with it: bodies take it over with
  /// their next image, the graph begins anew. What was learned and not stored is gone.
  /// @param stored  as it came back from MapStore::commit   @return see above
  Expected<void> begin_anew(TagMap stored, std::int64_t utc_now_ns);
  /// Where the room is, seen from W. Moves neither tags nor bodies in here, but what clients get
  /// (RoomAxes).
  void align(const Pose& X_RW, std::int64_t utc_now_ns);
  /// The tag is kept and not used, until it is forgotten or this map is replaced.
  Expected<void> quarantine(int tag_id, std::int64_t utc_now_ns);
  /// The map and all bodies know nothing of the tag any more; seen again, it is a new one.
  /// @return Error when the map is frozen, does not have it, or hangs on it
  Expected<void> forget(int tag_id, std::int64_t utc_now_ns);

 private:
  [[nodiscard]] bool ready(const TagBelief& belief) const;
  [[nodiscard]] bool may_define_locked(int body_id) const;
  void note_workspace_locked(const MapContribution& contribution);
  /// The three below: @return true when the published map should follow.
  bool absorb_locked(int body_id, const TagBelief& belief, std::int64_t utc_now_ns);
  bool quarantine_locked(const MapContribution& contribution, int tag_id);
  bool relearn_locked(int body_id, const TagBelief& belief, MapTag& entry, TagOwner& owner);
  bool watch_locked(const MapContribution& contribution, std::int64_t utc_now_ns);
  bool suspect_locked(const TagSuspicion& suspicion, std::int64_t utc_now_ns);
  bool find_again_locked(const GraphTagEstimate& found, std::span<const GraphTagEstimate> all,
                         MapTag& entry);
  void note_contradicted_once_locked(int body_id, int tag_id, const char* what_holds);
  [[nodiscard]] Expected<MapTag*> tag_locked(int tag_id);
  void leave_out_locked(int tag_id);
  bool settle_locked(MapTag& entry, TagOwner& owner, bool moved);
  [[nodiscard]] bool accept_locked(int body_id, const TagBelief& belief, const MapTag& entry,
                                   TagOwner& owner);
  MapTag& add_locked(int body_id, const TagBelief& belief);
  MapTag& insert_locked(const KnownTag& tag, const std::string& seen_by);
  void replace_known_locked(KnownMap known);
  void publish_locked(std::int64_t utc_now_ns);
  void note_locked(MapEvent::Kind kind, int tag_id, std::string text);

  MapConfig config_;
  mutable std::mutex mutex_;           ///< Guards all but snapshot_.
  mutable std::mutex snapshot_mutex_;  ///< Guards the pointer only; taken last.
  std::shared_ptr<const TagMap> snapshot_;
  TagMap working_;
  std::map<int, TagOwner> ownership_;         ///< Of every tag that may still move.
  TagWatch watch_;                            ///< With a graph …
  MovedTags moved_;                           ///< … also this.
  MapNews news_;                              ///< For bodies: what an operator did.
  std::shared_ptr<const TagMap> begin_anew_;  ///< For the graph, until it takes it.
  std::set<int> contradicted_;                ///< Tags that were said to stay all the same.
  bool starts_with_places_;                   ///< The starting map says where the workspace is.
  bool has_workspace_;                        ///< … or a body has since.
  std::optional<int> founder_;   ///< The body that defined the workspace, without a reference tag.
  std::optional<int> defining_;  ///< The body that may define it between its view and its absorb.
  std::vector<Waiting::OfBody> segments_;  ///< For the graph.
  std::vector<MapEvent> events_;
  std::uint64_t revision_{0}, contributions_{0};
  Instant newest_at_{};  ///< Of all contributions.
  bool changed_{false};
};

}  // namespace fiducap
