#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "estimation/tag_belief.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

enum class MapMode {
  kMapping,  ///< The map grows and is refined live.
  kFrozen,   ///< The map never changes: no control loop sees a jump.
};

struct MapConfig {
  MapMode mode{MapMode::kMapping};
  double publish_position_sigma_m{
      0.05};  ///< A belief joins the map when its tag is known better than this …
  double publish_rotation_sigma_rad{0.05};  ///< … and this (worst axis).
  int publish_sightings{10};                ///< … and was seen at least this often.
  double commit_period_s{10.0};             ///< A changed map is written to the store this often.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Something about the map that people and protocols should hear of.
struct MapEvent {
  enum class Kind {
    kTagAdded,    ///< A tag joined the map.
    kTagRefined,  ///< Another body knows the tag better and owns it now.
    kPublished,   ///< The map was stored as a version.
  } kind{Kind::kPublished};
  int tag_id{};  ///< 0 for kPublished.
  std::string text;
};

/// Joins the tag beliefs of all bodies into the one shared map.
///
/// Tags that start calibrated, surveyed or quarantined stay as they are. A new tag belongs to the
/// body that knows it best: its belief is copied, beliefs of different bodies are never averaged
/// (they share known tags, so they are not independent). Another body takes a tag over when its
/// position variance is 30 % smaller; a belief that much worse than the map's is ignored, whoever
/// it comes from. The joint refinement over keyframes of all bodies will take this place.
///
/// A snapshot is published when a tag is new, moved by 0.1 mm or 0.01°, or its 1-sigma changed by a
/// tenth, each against the published map; sightings and times travel along with the next one. The
/// snapshot keeps the version it came from; its `hash` is empty as soon as it differs from that
/// version. Thread-safe: `absorb` from the workers, `snapshot` from anywhere; who reads never waits
/// for a copy of the map.
class MapBuilder final {
 public:
  MapBuilder(const MapConfig& config, TagMap start);

  /// @param beliefs     in the workspace axes; not finite or too uncertain ones are passed over
  /// @param utc_now_ns  for first/last seen, and the time of creation of what is published
  void absorb(int body_id, std::span<const TagBelief> beliefs, std::int64_t utc_now_ns);
  [[nodiscard]] std::shared_ptr<const TagMap> snapshot() const;
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
    std::optional<int> body_id;  ///< nullopt: a local tag of the starting map.
    Instant last_seen{};
  };
  [[nodiscard]] bool ready(const TagBelief& belief) const;
  /// @return true when the published map should follow.
  bool absorb_locked(int body_id, const TagBelief& belief, std::int64_t utc_now_ns);
  MapTag& add_locked(int body_id, const TagBelief& belief);
  void publish_locked(std::int64_t utc_now_ns);
  void note_locked(MapEvent::Kind kind, int tag_id, std::string text);

  MapConfig config_;
  mutable std::mutex mutex_;           ///< Guards all but snapshot_.
  mutable std::mutex snapshot_mutex_;  ///< Guards the pointer only; taken last.
  std::shared_ptr<const TagMap> snapshot_;
  TagMap working_;
  std::map<int, Ownership> ownership_;  ///< Of every tag that may still move.
  std::vector<MapEvent> events_;
  bool changed_{false};
};

}  // namespace fiducap
