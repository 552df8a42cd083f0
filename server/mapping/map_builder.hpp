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
  double publish_position_sigma_m{0.05};   ///< A belief joins the map when its tag is known better than this …
  double publish_rotation_sigma_rad{0.05}; ///< … and this (worst axis).
  int publish_sightings{10};               ///< … and was seen at least this often.
  double commit_period_s{10.0};            ///< A changed map is written to the store this often.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Something about the map that people and protocols should hear of.
struct MapEvent {
  enum class Kind { kTagAdded, kTagRefined, kPublished } kind{Kind::kPublished};
  int tag_id{};
  std::string text;
};

/// Joins the tag beliefs of all bodies into the one shared map.
///
/// Tags of the starting map stay as they are. A new tag belongs to the body that knows it best: its belief is copied,
/// beliefs of different bodies are never averaged (they share known tags, so they are not independent). The joint
/// refinement over keyframes of all bodies will take this place.
/// Thread-safe: `absorb` from the workers, `snapshot` from anywhere; one short lock, no computing of maps inside it
/// that grows with anything but the number of tags.
class MapBuilder final {
 public:
  MapBuilder(const MapConfig& config, TagMap start);

  /// @param utc_now_ns  for first/last seen
  void absorb(int body_id, std::span<const TagBelief> beliefs, std::int64_t utc_now_ns);
  [[nodiscard]] std::shared_ptr<const TagMap> snapshot() const;
  /// @return true when the map differs from what was last marked as stored.
  [[nodiscard]] bool changed() const;
  /// `stored` came back from MapStore::commit(*snapshot): version numbers move on, content stays.
  void mark_stored(const TagMap& stored);
  void set_mode(MapMode mode);
  [[nodiscard]] MapMode mode() const;

 private:
  struct Owned {
    int body_id{};
    MapTag entry;
  };
  void publish_locked();

  MapConfig config_;
  mutable std::mutex mutex_;
  std::shared_ptr<const TagMap> snapshot_;
  std::map<int, Owned> session_tags_;
  bool changed_{false};
};

}  // namespace fiducap
