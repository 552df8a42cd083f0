#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/store/map_rows.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The comment of versions that the server stores by itself. Only these are thinned out.
inline constexpr const char* kAutomaticComment = "mapped by fiducapd";

/// 1 to 200 characters, none of them a control character, and not the server's own comment.
[[nodiscard]] Expected<void> check_version_name(const std::string& name);

/// The file that a repair has written and not yet put in the place of the damaged store.
[[nodiscard]] std::string repaired_name(const std::string& path);

/// A version whose content does not have the stored hash.
struct DamagedVersion {
  std::int64_t version{};
  std::string fault;
};

struct SoundVersion {
  TagMap map;                           ///< Of version 0 when nothing was committed yet.
  std::vector<DamagedVersion> damaged;  ///< Newer ones, newest first.
};

/// A copy of a store.
struct MapBackup {
  std::size_t versions{};
  std::int64_t newest{};                ///< Newest undamaged version; 0: none.
  std::vector<DamagedVersion> damaged;  ///< Newer ones, as in the store.
};

class FileClaim;

/// Accepted versions of one map, in one SQLite file (WAL, synced at each commit). A kill or a power
/// cut at any instant loses at most the version being written; a version that `commit` returned is
/// on the disk. One process writes; others may read. Each version carries the hash of its content,
/// checked when it is loaded. Not thread-safe.
class MapStore final {
 public:
  /// Opens or creates. A damaged file is never overwritten.
  /// @return Error `kInvalid` for a damaged file, with what to do
  [[nodiscard]] static Expected<MapStore> open(const std::string& path);
  /// For reading, also of a damaged file: nothing is created or changed, and versions are checked
  /// when they are loaded.
  [[nodiscard]] static Expected<MapStore> open_to_read(const std::string& path);
  /// Copies a store, also while a server writes to it: all versions at one instant.
  /// @param to  replaced atomically
  [[nodiscard]] static Expected<MapBackup> back_up(const std::string& path, const std::string& to);
  /// For writers: until this is destroyed no other process can claim the store.
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
  /// The name replaces its comment, so that it is not thinned out (see kAutomaticComment).
  /// @return Error `kInvalid` when that is no name (check_version_name), `kNotFound` when there is
  /// no such version
  [[nodiscard]] Expected<void> name_version(std::int64_t version, const std::string& name);
  /// Removes old automatic versions (versions_to_thin), a few at a time, in one transaction, and
  /// returns free space to the disk when it is much. Damaged ones stay.
  /// @return number of removed versions
  [[nodiscard]] Expected<int> thin();
  /// @return the newest version, or an empty map of version 0 when nothing was committed yet; Error
  /// when it is damaged
  [[nodiscard]] Expected<TagMap> newest() const;
  /// @return the newest undamaged version; Error when there are only damaged ones
  [[nodiscard]] Expected<SoundVersion> newest_sound() const;
  [[nodiscard]] Expected<TagMap> load(std::int64_t version) const;
  [[nodiscard]] Expected<std::vector<MapVersionInfo>> log() const;  ///< Newest first.
  [[nodiscard]] Expected<void> save_extrinsics(const StoredExtrinsics& extrinsics);
  [[nodiscard]] Expected<std::vector<StoredExtrinsics>> extrinsics() const;

 private:
  explicit MapStore(SqliteFile file);
  std::unique_ptr<SqliteFile> file_;
  std::unique_ptr<FileClaim> claim_;
};

struct VersionAge {
  std::int64_t version{};
  std::int64_t created_utc_ns{};
  bool automatic{};  ///< Stored by the server itself; others are never thinned out.
};

/// The automatic versions that may be removed. Kept are all of the last ten minutes, one a minute
/// of the hour before, one per ten minutes of the day, one an hour of the week, one a day of the
/// year, then one per 30 days: the last of each such span. Ages count from the newest version,
/// which is kept, so that a server that was off for a year finds its versions.
/// @param newest_first  all versions of the store
[[nodiscard]] std::vector<std::int64_t> versions_to_thin(std::span<const VersionAge> newest_first);

}  // namespace fiducap
