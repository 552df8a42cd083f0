#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/store/map_store.hpp"

namespace fiducap {

/// What a look at every version of a store found.
struct MapStoreHealth {
  std::string structure;                ///< What SQLite says of the file; empty: nothing wrong.
  std::vector<std::int64_t> sound;      ///< Versions that are as they were stored, ascending.
  std::vector<DamagedVersion> damaged;  ///< Ascending.
  std::vector<std::string> losses;      ///< What else cannot be read, in words.

  [[nodiscard]] bool is_sound() const {
    return structure.empty() && damaged.empty() && losses.empty();
  }
  /// What is not sound, one sentence each.
  [[nodiscard]] std::vector<std::string> sentences() const;
};

/// Reads everything, changes nothing.
[[nodiscard]] Expected<MapStoreHealth> check_map_store(const std::string& path);

/// Writes every sound version of `from`, under its number, into the new store `to`; each becomes
/// the child of its nearest ancestor that is there. Versions that are damaged are left out, since
/// half a map would look like a whole one. `from` is not changed.
/// @return Error when nothing can be read or `to` cannot be written
[[nodiscard]] Expected<MapStoreHealth> salvage_map_store(const std::string& from,
                                                         const std::string& to);

struct MapRepair {
  MapStoreHealth found;
  std::string kept_as;  ///< Where the damaged file is now; empty: it was sound and is as it was.
};

/// Puts what `salvage_map_store` finds in the place of a damaged store, which is kept beside it as
/// `<path>.damaged-<n>`. A repair that was interrupted anywhere is finished by the next one; until
/// then `MapStore::open` refuses the file.
/// @return Error when the store is in use, nothing can be read or written; it is as it was then
[[nodiscard]] Expected<MapRepair> repair_map_store(const std::string& path);

}  // namespace fiducap
