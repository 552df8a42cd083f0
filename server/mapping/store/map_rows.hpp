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
  double shift_s{};  ///< The configured shift plus the estimated one.
  double readout_s{};
};

/// Parameters of a lens that differ from the configuration (LensOffset).
struct StoredLens {
  std::optional<double> focal{};
  std::optional<double> centre_u_px{};
  std::optional<double> centre_v_px{};
  std::optional<double> k1{};

  [[nodiscard]] bool is_none() const { return !focal && !centre_u_px && !centre_v_px && !k1; }
};

/// Estimates about one camera of one body.
struct StoredExtrinsics {
  std::string body;
  int camera{};
  Pose X_BV;
  std::optional<StoredClock> clock{};  ///< Once it is known well.
  StoredLens lens{};                   ///< Replaces the stored one.
};

// Maps in the tables of a store. Writers are called inside a transaction.

/// In a file that has no tables yet.
[[nodiscard]] Expected<void> create_tables(SqliteFile& file);
/// Brings a store of an older schema to this one, in a transaction of its own.
[[nodiscard]] Expected<void> migrate(SqliteFile& file);
/// @param map  with version, parent and hash
[[nodiscard]] Expected<void> insert_map(const SqliteFile& file, const TagMap& map);
/// @return Error `kInvalid` when the content does not have the stored hash, `kNotFound` when there
/// is no such version
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
/// PRAGMA user_version: written by this program, which reads all earlier ones. 2: with
/// correlations; 3: with lenses.
inline constexpr std::int64_t kMapStoreSchema = 3;

// Correlations of a version's tags (TagMap::known), the prior of the next session, with the tags
// whose size differs from the configured one: one row per version that has them (tie_rows.cpp).

/// In a new store, or in one of schema 1, which has no such table.
[[nodiscard]] Expected<void> create_ties(SqliteFile& file);
/// Nothing when the map has none.
[[nodiscard]] Expected<void> insert_ties(const SqliteFile& file, const TagMap& map);
/// Sets `map.known`; it stays nullptr when the version has none.
/// @return Error `kInvalid` when the content does not have the stored hash
[[nodiscard]] Expected<void> load_ties(const SqliteFile& file, TagMap& map,
                                       const std::string& context);
[[nodiscard]] Expected<void> remove_ties(const SqliteFile& file, std::int64_t version);
/// Removes those of automatic versions before this one: they are as large as the rest of the store,
/// and a map that is rolled back to such a version estimates them again.
[[nodiscard]] Expected<void> remove_old_ties(const SqliteFile& file, std::int64_t newest,
                                             const std::string& automatic_comment);

}  // namespace fiducap
