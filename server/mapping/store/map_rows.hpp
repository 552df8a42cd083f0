#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

class SqliteFile;

/// One line of the map's history.
struct MapVersionInfo {
  std::int64_t version{};
  std::int64_t parent{};  ///< The nearest ancestor that is still there; 0: none.
  std::int64_t created_utc_ns{};
  std::string hash;
  std::string comment;
  int tags{};
};

/// When a camera's rows are exposed (ClockEstimate).
struct StoredClock {
  double shift_s{};  ///< All of it: what the configuration told, and what was learned beyond.
  double readout_s{};
};

/// What of a lens was found to be otherwise than configured (LensOffset).
struct StoredLens {
  std::optional<double> focal{};
  std::optional<double> centre_u_px{};
  std::optional<double> centre_v_px{};
  std::optional<double> k1{};

  [[nodiscard]] bool is_none() const { return !focal && !centre_u_px && !centre_v_px && !k1; }
};

/// What was learned about one camera of one body.
struct StoredExtrinsics {
  std::string body;
  int camera{};
  Pose X_BV;
  std::optional<StoredClock> clock{};  ///< Once it is known well.
  StoredLens lens{};                   ///< What was found before, and is not any more, goes.
};

// How maps lie in the tables of a store. Writers are called inside a transaction.

/// In a file that has no tables yet.
[[nodiscard]] Expected<void> create_tables(SqliteFile& file);
/// Brings a store of an older schema to this one, in a transaction of its own.
[[nodiscard]] Expected<void> migrate(SqliteFile& file);
/// @param map  with version, parent and hash
[[nodiscard]] Expected<void> insert_map(const SqliteFile& file, const TagMap& map);
/// @return Error `kInvalid` when what lies there is not what was stored (hash), `kNotFound` when
/// there is no such version
[[nodiscard]] Expected<TagMap> load_map(const SqliteFile& file, std::int64_t version);
/// @return Error `kNotFound` when there is no such version
[[nodiscard]] Expected<void> set_comment(const SqliteFile& file, std::int64_t version,
                                         const std::string& comment);
/// Children of the version become children of its parent.
[[nodiscard]] Expected<void> remove_map(const SqliteFile& file, std::int64_t version);
[[nodiscard]] Expected<std::vector<MapVersionInfo>> list_maps(const SqliteFile& file);
[[nodiscard]] Expected<void> save_extrinsics(const SqliteFile& file, const StoredExtrinsics& one);
[[nodiscard]] Expected<std::vector<StoredExtrinsics>> load_extrinsics(const SqliteFile& file);

/// PRAGMA application_id of a store: "FDCP".
inline constexpr std::int64_t kMapStoreId = 0x46444350;
/// PRAGMA user_version: what this program writes; it reads all before. 2: with ties (tie_rows.hpp);
/// 3: with what is wrong about lenses.
inline constexpr std::int64_t kMapStoreSchema = 3;

}  // namespace fiducap
