#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_map.hpp"

namespace fiducap {

enum class TagState {
  kLocal,        ///< Mapped by one body in this session, still moving.
  kCalibrated,   ///< Settled: an input for every body.
  kSurveyed,     ///< Given from outside.
  kQuarantined,  ///< Contradicts its neighbours: kept, not used.
};

[[nodiscard]] std::string_view name_of(TagState state);
[[nodiscard]] std::optional<TagState> tag_state_from(std::string_view name);

struct MapTag {
  KnownTag tag;  ///< id, edge, X_WT, covariance
  TagState state{TagState::kLocal};
  std::int64_t first_seen_utc_ns{};
  std::int64_t last_seen_utc_ns{};
  int sightings{};
  int component{};  ///< Tags not connected by any sighting lie in different components. 0 holds the
                    ///< workspace.
};

/// Where every tag of the workspace is. Immutable once published: `shared_ptr<const TagMap>` is
/// what travels.
struct TagMap {
  std::int64_t version{0};  ///< 0: never stored.
  std::int64_t parent{0};
  std::string
      hash;  ///< Of the stored version, hex; set by the store. Empty: differs from every version.
  std::string family{"tag36h11"};
  std::optional<int> reference_tag;
  Pose X_RW;  ///< Alignment of the workspace to the room.
  std::int64_t created_utc_ns{};
  std::string comment;
  std::vector<MapTag> tags;  ///< Sorted by id, ids unique.
  /// The tags that the map graph has placed, and what their errors share; nullptr: no graph has.
  std::shared_ptr<const KnownMap> known;

  [[nodiscard]] const MapTag* find(int tag_id) const;
  [[nodiscard]] MapTag* find(int tag_id);
  /// The tags of `seen` that a filter may lean on (not quarantined, component 0), appended to `out`
  /// after clearing it.
  void known_among(const TagObservations& seen, std::vector<KnownTag>& out) const;
};

/// @return the first thing that makes this not a map (order of ids, edge, finite numbers, unit
/// quaternions, variances
///         below zero), e.g. `tag 7: edge_m = -1: must be finite and > 0`; nullopt when it is one.
[[nodiscard]] std::optional<std::string> fault_in(const TagMap& map);
/// @return the same for one tag, without its id.
[[nodiscard]] std::optional<std::string> fault_in(const MapTag& entry);

/// Hash of everything a version says (family, reference tag, alignment, tags with history; not
/// version numbers, time of creation and comment). FNV-1a, 64 bit, 16 hex digits, over the numbers
/// as little-endian bytes: finds changes and damage, no protection against forgery.
[[nodiscard]] std::string content_hash(const TagMap& map);
/// That hash of any bytes.
[[nodiscard]] std::string hash_of(std::span<const std::byte> bytes);

}  // namespace fiducap
