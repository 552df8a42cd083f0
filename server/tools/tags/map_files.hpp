#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/formats/map_format.hpp"
#include "mapping/map_edit.hpp"
#include "mapping/store/map_store.hpp"
#include "mapping/tag_map.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

/// Reads a map file of any known format.
/// @param format  nullopt: by the content, else by the name
/// @return the map, and what had to be assumed or left out
[[nodiscard]] Expected<ImportedMap> import_map_file(const std::string& path,
                                                    std::optional<MapFormat> format,
                                                    const MapImportOptions& options);

/// Reads a map file of ours, `.yaml` or `.csv`: these leave nothing to assume.
[[nodiscard]] Expected<TagMap> read_map_file(const std::string& path);

/// Writes a map.
/// @param format  nullopt: by the name, `.yaml` `.yml` ours, `.csv`, `.json` WPILib's
/// @return what the format cannot express
[[nodiscard]] Expected<std::vector<std::string>> write_map_file(
    const std::string& path, const TagMap& map, std::optional<MapFormat> format = std::nullopt,
    std::optional<FieldSize> field = std::nullopt);

/// A store that exists: reading must not leave an empty store behind when the name was wrong.
[[nodiscard]] Expected<MapStore> open_existing_store(const std::string& path);

/// The given version, or the newest undamaged one; skipped versions are reported.
[[nodiscard]] Expected<TagMap> version_of(const MapStore& store,
                                          std::optional<std::int64_t> version,
                                          const Terminal& terminal);
/// The same of the store at `path`.
[[nodiscard]] Expected<TagMap> stored_version(const std::string& path,
                                              std::optional<std::int64_t> version,
                                              const Terminal& terminal);

enum class MapOrigin {
  kFile,   ///< The next version follows the newest one.
  kStore,  ///< It is a version of this store, and the parent of the next one.
};

/// Stores the map as the next version; makes the store when there is none. Skipped versions are
/// reported. @return the map as stored
[[nodiscard]] Expected<TagMap> store_next_version(const std::string& store, TagMap map,
                                                  const std::string& comment,
                                                  const Terminal& terminal,
                                                  MapOrigin origin = MapOrigin::kFile);

/// Reads places of tags that were measured in the room: CSV with the header `id,x,y,z`, metres, one
/// tag a line; empty lines and those that begin with # are skipped.
/// @return Error with file, line, what was expected and what was found
[[nodiscard]] Expected<std::vector<MeasuredPlace>> read_measured_places(const std::string& file);

/// Largest 1-sigma along an axis, position in metres and attitude in radians.
[[nodiscard]] std::pair<double, double> largest_sigmas(const KnownTag& tag);

/// For people: `hall.map: version 7, 12 tags, hash …`
void print_stored(const std::string& store, const TagMap& map, const Terminal& terminal);
/// Number, parent, tags, hash and comment of a version that was stored or written, for scripts.
[[nodiscard]] nlohmann::ordered_json version_json(const std::string& file, const TagMap& map);

}  // namespace fiducap
