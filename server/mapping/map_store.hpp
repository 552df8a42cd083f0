#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "mapping/map_diff.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// One line of the map's history.
struct MapVersionInfo {
  std::int64_t version{};
  std::int64_t parent{};
  std::int64_t created_utc_ns{};
  std::string hash;
  std::string comment;
  int tags{};
};

/// When a camera's rows are exposed (ClockEstimate).
struct StoredClock {
  double shift_s{};
  double readout_s{};
};

/// What was learned about one camera of one body.
struct StoredExtrinsics {
  std::string body;
  int camera{};
  Pose X_BV;
  std::optional<StoredClock> clock{};  ///< Once it is known well.
};

/// Every accepted version of one map, in one SQLite file (WAL, synchronous=FULL). A kill at any
/// instant loses at most the version being written; a version that `commit` returned is on the
/// disk. One process writes; others may read. Each version carries the hash of its content, checked
/// when it is loaded. Not thread-safe.
class MapStore final {
 public:
  /// Opens or creates. A damaged file is an Error that says so and what to do; it is never
  /// overwritten.
  [[nodiscard]] static Expected<MapStore> open(const std::string& path);
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
  /// @return the newest version, or an empty map of version 0 when nothing was committed yet.
  [[nodiscard]] Expected<TagMap> newest() const;
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
