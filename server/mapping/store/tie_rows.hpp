#pragma once

#include <cstdint>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

class SqliteFile;

// How the errors of a version's tags hang together (TagMap::known): one row per version that has
// such ties, by which the map goes on learning where it stopped, and which prints were found to be
// of another size than told. Writers are called inside a transaction.

/// In a store of schema 1, which has no such table, or in a new one.
[[nodiscard]] Expected<void> create_ties(SqliteFile& file);
/// Nothing when the map has none.
[[nodiscard]] Expected<void> insert_ties(const SqliteFile& file, const TagMap& map);
/// Fills in `map.known`; it stays nullptr when the version has none.
/// @return Error `kInvalid` when what lies there is not what was stored
[[nodiscard]] Expected<void> load_ties(const SqliteFile& file, TagMap& map,
                                       const std::string& context);
[[nodiscard]] Expected<void> remove_ties(const SqliteFile& file, std::int64_t version);
/// They are as large as all else together, and whoever goes back to an automatic version of some
/// minutes ago may learn them anew: those of automatic versions before this one go.
[[nodiscard]] Expected<void> remove_old_ties(const SqliteFile& file, std::int64_t newest,
                                             const std::string& automatic_comment);

}  // namespace fiducap
