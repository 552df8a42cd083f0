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

#include "estimation/segment/motion_segment.hpp"
#include "estimation/tag_belief.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/map_config.hpp"
#include "mapping/map_event.hpp"
#include "mapping/moved_tags.hpp"
#include "mapping/tag_map.hpp"
#include "mapping/tag_watch.hpp"

namespace fiducap {

/// The map as one body gets it for one image.
struct MapView {
  std::shared_ptr<const TagMap> map;
  bool may_define_workspace{true};  ///< See MapKnowledge.
  std::uint64_t revision{};         ///< How often the map was published before; counts from 0.
};

/// What one body tells the map after an image.
struct MapContribution {
  int body_id{};
  Instant at{};
  bool anchored{};  ///< The body's filter stands in the workspace.
  std::span<const TagBelief> beliefs{};
  std::span<const int> contradicted{};  ///< Tags that the body's filter gave up for their place.
  std::span<const int> fitting{};       ///< Tags that it found where the map has them.
  std::shared_ptr<const MotionSegment> segment{};  ///< That has ended, or nullptr.
};

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

 private:
  struct Ownership {
    std::optional<int> body_id{};  ///< nullopt: a local tag of the starting map.
    Instant last_seen{};
    std::optional<Instant> still_since{};  ///< When the published place last changed, by the owner.
    std::optional<Instant> quarantined_at{};
    TagState before{TagState::kLocal};     ///< What it was before the quarantine.
    std::optional<Instant> disputed_at{};  ///< Contradicted, but not moved: stays where it is.
  };
  [[nodiscard]] bool ready(const TagBelief& belief) const;
  [[nodiscard]] bool may_define_locked(int body_id) const;
  void note_workspace_locked(const MapContribution& contribution);
  /// The three below: @return true when the published map should follow.
  bool absorb_locked(int body_id, const TagBelief& belief, std::int64_t utc_now_ns);
  bool quarantine_locked(const MapContribution& contribution, int tag_id);
  bool relearn_locked(int body_id, const TagBelief& belief, MapTag& entry, Ownership& owner);
  bool watch_locked(const MapContribution& contribution, std::int64_t utc_now_ns);
  bool suspect_locked(const TagSuspicion& suspicion, std::int64_t utc_now_ns);
  bool find_again_locked(const GraphTagEstimate& found, std::span<const GraphTagEstimate> all,
                         MapTag& entry);
  void note_contradicted_once_locked(int body_id, int tag_id, const char* what_holds);
  bool settle_locked(MapTag& entry, Ownership& owner, bool moved);
  [[nodiscard]] bool accept_locked(int body_id, const TagBelief& belief, const MapTag& entry,
                                   Ownership& owner);
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
  std::map<int, Ownership> ownership_;  ///< Of every tag that may still move.
  TagWatch watch_;                      ///< With a graph …
  MovedTags moved_;                     ///< … also this.
  std::set<int> contradicted_;          ///< Tags that were said to stay all the same.
  bool starts_with_places_;             ///< The starting map says where the workspace is.
  bool has_workspace_;                  ///< … or a body has since.
  std::optional<int> founder_;   ///< The body that defined the workspace, without a reference tag.
  std::optional<int> defining_;  ///< The body that may define it between its view and its absorb.
  std::vector<Waiting::OfBody> segments_;  ///< For the graph.
  std::vector<MapEvent> events_;
  std::uint64_t revision_{0};
  std::uint64_t contributions_{0};
  bool changed_{false};
};

}  // namespace fiducap
