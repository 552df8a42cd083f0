#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/map_view.hpp"
#include "mapping/moved_tags.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

enum class MapMode {
  kMapping,  ///< The map grows and is refined live.
  kFrozen,   ///< The map never changes: no control loop sees a jump.
};

struct MapConfig {
  MapMode mode{MapMode::kMapping};
  int publish_sightings{10};  ///< A tag joins the map when it was seen this often.
  /// Period of the joint solution over the measurements of all bodies, in seconds of their data.
  double refine_period_s{2.0};
  double commit_period_s{10.0};  ///< A changed map is written to the store this often.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// The one shared map of all bodies, as their map graph solves it. Owns the workspace.
///
/// The workspace is defined once: by the reference tag or, without one, by the first body that
/// anchors itself while the map is empty; all others wait for a tag of the map. A body asks for a
/// `view` before each image and contributes after it; in between it alone may define the workspace.
///
/// Surveyed tags are never changed. Solutions of the graph place all others (adopt), and TagWatch
/// detects which have left their places.
///
/// The snapshot keeps the version it came from; its `hash` is empty as soon as it differs from that
/// version. Thread-safe; reading a snapshot never waits for a copy of the map.
class MapBuilder final {
 public:
  MapBuilder(const MapConfig& config, TagMap start);

  /// For the next image of a body.
  [[nodiscard]] MapView view(int body_id);
  /// @param utc_now_ns  for first/last seen, and the time of creation of the published map
  /// @return number of contributions before this one
  std::uint64_t absorb(const MapContribution& contribution, std::int64_t utc_now_ns);
  /// What has arrived since the last call, in order.
  struct Waiting {
    struct OfBody {
      int body_id{};
      std::shared_ptr<const MotionSegment> segment;
    };
    std::vector<OfBody> segments;
    /// The map was replaced: everything taken before is void. To be applied before the moves.
    std::shared_ptr<const TagMap> replacement;
    std::vector<EpochOrder> moves;  ///< To be applied before the segments.
    std::uint64_t contributions{};  ///< Number of all so far.
  };
  [[nodiscard]] Waiting take_segments();
  /// Publishes the solution of all segments so far.
  /// @return number of contributions before
  std::uint64_t adopt(GraphSolution solution, std::int64_t utc_now_ns);
  /// No more contributions come from this body; its right to define the workspace is released.
  void release(int body_id);
  [[nodiscard]] std::shared_ptr<const TagMap> snapshot() const;
  /// The snapshot with its revision; reserves nothing.
  [[nodiscard]] MapView published() const;
  /// @return true when the map differs from the last stored one
  [[nodiscard]] bool changed() const;
  /// `stored` came back from MapStore::commit(*snapshot): version numbers advance, content stays.
  void mark_stored(const TagMap& stored);
  /// Events since the last call, oldest first; the newest 256 are kept.
  [[nodiscard]] std::vector<MapEvent> take_events();
  void set_mode(MapMode mode);
  [[nodiscard]] MapMode mode() const;

  // For operators (map_by_hand.cpp). Errors are shown to the user.

  /// @return Error when the map is frozen, or `map` does not define a workspace
  [[nodiscard]] Expected<void> check_replacement(const TagMap& map) const;
  /// Serves another map from now on: bodies adopt it with their next image, the graph restarts.
  /// Estimates that were not stored are lost.
  /// @param stored  as it came back from MapStore::commit   @return see check_replacement
  Expected<void> replace_map(TagMap stored, std::int64_t utc_now_ns);
  /// Sets the pose of W in the room. Moves neither tags nor bodies here, but the poses that clients
  /// get (RoomAxes).
  void align(const Pose& X_RW, std::int64_t utc_now_ns);
  /// The tag is kept and not used, until it is forgotten or this map is replaced.
  Expected<void> quarantine(int tag_id, std::int64_t utc_now_ns);
  /// Seen again, it is a new tag.
  /// @return Error when the map is frozen, does not have the tag, or the tag defines the workspace
  Expected<void> forget(int tag_id, std::int64_t utc_now_ns);

 private:
  static constexpr int kSightingsToSettle = 100;

  [[nodiscard]] bool may_define_locked(int body_id) const;
  void note_contradicted_once_locked(int body_id, int tag_id, const char* reason);
  void note_locked(MapEvent::Kind kind, int tag_id, std::string text);
  [[nodiscard]] Expected<MapTag*> tag_locked(int tag_id);
  MapTag& insert_locked(const KnownTag& tag);
  void publish_locked(std::int64_t utc_now_ns);
  bool watch_locked(const MapContribution& contribution, std::int64_t utc_now_ns);
  bool displace_locked(const TagDisplacement& displacement, std::int64_t utc_now_ns);
  [[nodiscard]] const MapTag* place_locked(const GraphTagEstimate& tag,
                                           std::span<const GraphTagEstimate> all, Instant newest,
                                           std::int64_t utc_now_ns);
  void exclude_from_known_locked(int tag_id);
  void replace_known_locked(KnownMap known);

  MapConfig config_;
  mutable std::mutex mutex_;           ///< Guards all but snapshot_.
  mutable std::mutex snapshot_mutex_;  ///< Guards the pointer only; taken last.
  std::shared_ptr<const TagMap> snapshot_;
  TagMap working_;
  TagWatch watch_;
  MovedTags moved_;
  std::shared_ptr<const TagMap> replacement_;  ///< For the graph, until it takes it.
  std::uint64_t replaced_at_{0};               ///< Revision; contributions to older ones are void.
  std::set<int> contradicted_;                 ///< Tags whose contradiction was reported.
  bool starts_with_workspace_;                 ///< The starting map defines it …
  bool has_workspace_;                         ///< … or a body has since.
  bool is_solved_{false};                      ///< By the graph, in this session.
  std::set<int> contributors_;                 ///< Bodies with segments in the graph.
  std::optional<int> founder_;   ///< The body that defined the workspace, without a reference tag.
  std::optional<int> defining_;  ///< The body that may define it between its view and its absorb.
  std::vector<Waiting::OfBody> segments_;  ///< For the graph.
  std::vector<MapEvent> events_;
  std::uint64_t revision_{0}, contributions_{0};
  Instant newest_at_{};  ///< Of all contributions.
  bool changed_{false};
};

}  // namespace fiducap
