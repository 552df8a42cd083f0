#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

enum class TagState {
  kLocal,        ///< Mapped in this session, its estimate still changes.
  kCalibrated,   ///< Settled: an input for every body.
  kSurveyed,     ///< Given by the user.
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
  int component{};  ///< Tags that no sighting connects are in different ones; 0: the workspace's.

  /// Filters may use it: in the workspace, and not quarantined.
  [[nodiscard]] bool is_usable() const { return component == 0 && state != TagState::kQuarantined; }
};

/// The poses of all tags of the workspace. Immutable once published, as `shared_ptr<const TagMap>`.
struct TagMap {
  std::int64_t version{0};  ///< 0: never stored.
  std::int64_t parent{0};
  std::string hash;  ///< Of the stored version, hex; empty: differs from every version.
  std::string family{"tag36h11"};
  std::optional<int> reference_tag;
  Pose X_RW;  ///< Alignment of the workspace to the room.
  std::int64_t created_utc_ns{};
  std::string comment;
  std::vector<MapTag> tags;  ///< Sorted by id, ids unique.
  /// Tags placed by the map graph, and the correlations of their errors; nullptr: no graph has.
  std::shared_ptr<const KnownMap> known;

  [[nodiscard]] const MapTag* find(int tag_id) const;
  [[nodiscard]] MapTag* find(int tag_id);
  /// At its place in the order of ids. @pre there is none with this id
  MapTag& insert(MapTag entry);
  /// Some usable tag defines the workspace.
  [[nodiscard]] bool has_workspace() const;
  /// @param out  the usable tags of `seen`; cleared first
  void known_among(const TagObservations& seen, std::vector<KnownTag>& out) const;
};

/// @return the first fault (order of ids, edge, finite numbers, unit quaternions, negative
/// variances), e.g. `tag 7: edge_m = -1: must be finite and > 0`; nullopt: the map is valid
[[nodiscard]] std::optional<std::string> fault_in(const TagMap& map);
/// @return the same for one tag, without its id
[[nodiscard]] std::optional<std::string> fault_in(const MapTag& entry);

/// Hash of a version's content: family, reference tag, alignment, tags with history; not version
/// numbers, time of creation and comment. FNV-1a, 64 bit, 16 hex digits, over the numbers as
/// little-endian bytes: finds changes and damage, does not protect against forgery.
[[nodiscard]] std::string content_hash(const TagMap& map);
/// The same hash of any bytes.
[[nodiscard]] std::string hash_of(std::span<const std::byte> bytes);

/// The difference of one tag between two versions.
struct TagChange {
  int tag_id{};
  enum class Kind { kAdded, kRemoved, kMoved } kind{Kind::kMoved};
  double distance_mm{};
  double angle_deg{};
};

/// `added`, `removed`, `moved`
[[nodiscard]] std::string_view name_of(TagChange::Kind kind);

/// Added, removed and moved tags (above 1 µm or 1 µrad), sorted by id.
[[nodiscard]] std::vector<TagChange> diff(const TagMap& before, const TagMap& after);

/// The yaw and shift that maps the first point of each pair to the second, least squares.
[[nodiscard]] Pose fit_yaw_and_shift(
    std::span<const std::pair<Eigen::Vector3d, Eigen::Vector3d>> points);

}  // namespace fiducap
