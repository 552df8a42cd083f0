#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/map_diff.hpp"
#include "mapping/store/map_rows.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The comment of versions that the server stores by itself. Only these are thinned out.
inline constexpr const char* kAutomaticComment = "mapped by fiducapd";

/// 1 to 200 characters, none of them a control character, and not the server's own comment.
[[nodiscard]] Expected<void> check_version_name(const std::string& name);

/// What a repair has written and not yet put in the place of the damaged store.
[[nodiscard]] std::string repaired_name(const std::string& path);

/// A version that is there but not what was stored.
struct DamagedVersion {
  std::int64_t version{};
  std::string fault;
};

struct SoundVersion {
  TagMap map;                           ///< Of version 0 when nothing was committed yet.
  std::vector<DamagedVersion> damaged;  ///< Newer ones, newest first.
};

/// Accepted versions of one map, in one SQLite file (WAL, synced at each commit). A kill or a power
/// cut at any instant loses at most the version being written; a version that `commit` returned is
/// on the disk. One process writes; others may read. Each version carries the hash of its content,
/// checked when it is loaded. Not thread-safe.
class MapStore final {
 public:
  /// Opens or creates. A damaged file is an Error (`kInvalid`) that says so and what to do; it is
  /// never overwritten.
  [[nodiscard]] static Expected<MapStore> open(const std::string& path);
  /// For who only looks, also into a damaged file: nothing is created, changed or checked before it
  /// is asked for.
  [[nodiscard]] static Expected<MapStore> open_to_read(const std::string& path);
  /// For whoever will commit: until this is destroyed no other process can claim it.
  /// @return Error naming the process that has it
  [[nodiscard]] Expected<void> claim();
  ~MapStore();
  MapStore(MapStore&&) noexcept;
  MapStore& operator=(MapStore&&) noexcept;

  /// Writes `map` as the next version in one transaction; `created_utc_ns` is the caller's. Its
  /// parent is the version `map` came from, so an old version committed again is a roll-back that
  /// the history shows.
  /// @return the map with version, parent and hash filled in; Error on a full or read-only disk,
  /// the store as it was.
  [[nodiscard]] Expected<TagMap> commit(const TagMap& map, const std::string& comment);
  /// Its comment is the name from now on, and it is kept (see kAutomaticComment).
  /// @return Error `kInvalid` when that is no name (check_version_name), `kNotFound` when there is
  /// no such version
  [[nodiscard]] Expected<void> name_version(std::int64_t version, const std::string& name);
  /// Takes away automatic versions that have grown old (map_thinning.hpp), a few at a time, in one
  /// transaction, and gives the room back to the disk when it is much. Damaged ones stay.
  /// @return how many went
  [[nodiscard]] Expected<int> thin();
  /// @return the newest version, or an empty map of version 0 when nothing was committed yet; Error
  /// when it is damaged
  [[nodiscard]] Expected<TagMap> newest() const;
  /// @return the newest version that is as it was stored; Error when there are only others
  [[nodiscard]] Expected<SoundVersion> newest_sound() const;
  [[nodiscard]] Expected<TagMap> load(std::int64_t version) const;
  [[nodiscard]] Expected<std::vector<MapVersionInfo>> log() const;  ///< Newest first.
  [[nodiscard]] Expected<void> save_extrinsics(const StoredExtrinsics& extrinsics);
  [[nodiscard]] Expected<std::vector<StoredExtrinsics>> extrinsics() const;

 private:
  class Impl;
  explicit MapStore(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
