#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/store/map_store.hpp"

namespace fiducap {

/// The state of a store with all its versions.
struct MapStoreHealth {
  std::string structure;                ///< SQLite's report about the file; empty: sound.
  std::vector<std::int64_t> sound;      ///< Undamaged versions, ascending.
  std::vector<DamagedVersion> damaged;  ///< Ascending.
  std::vector<std::string> losses;      ///< Other unreadable parts, as sentences.

  [[nodiscard]] bool is_sound() const {
    return structure.empty() && damaged.empty() && losses.empty();
  }
  /// All faults, one sentence each.
  [[nodiscard]] std::vector<std::string> sentences() const;
};

/// Reads everything, changes nothing.
[[nodiscard]] Expected<MapStoreHealth> check_map_store(const std::string& path);

/// Writes every sound version of `from`, under its number, into the new store `to`; each becomes
/// the child of its nearest ancestor that is there. Damaged versions are left out, since half a map
/// would look like a whole one. `from` is not changed.
/// @return Error when nothing can be read or `to` cannot be written
[[nodiscard]] Expected<MapStoreHealth> salvage_map_store(const std::string& from,
                                                         const std::string& to);

struct MapRepair {
  MapStoreHealth found;
  std::string kept_as;  ///< Where the damaged file is now; empty: it was sound and is as it was.
};

/// Replaces a damaged store by the result of `salvage_map_store`, and keeps it beside as
/// `<path>.damaged-<n>`. An interrupted repair is finished by the next one; until then
/// `MapStore::open` refuses the file.
/// @return Error when the store is in use, nothing can be read or written; it is as it was then
[[nodiscard]] Expected<MapRepair> repair_map_store(const std::string& path);

}  // namespace fiducap
