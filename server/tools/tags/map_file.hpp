#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/formats/map_format.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Reads a map file of any known format.
/// @param format  nullopt: what the content, else the name says
/// @return the map, and what had to be assumed or left out
[[nodiscard]] Expected<ImportedMap> import_map_file(const std::string& path,
                                                    std::optional<MapFormat> format,
                                                    const MapImportOptions& options);

/// Reads a map file of ours, `.yaml` or `.csv`: these leave nothing to assume.
[[nodiscard]] Expected<TagMap> read_map_file(const std::string& path);

/// Writes a map.
/// @param format  nullopt: what the name says, `.yaml` `.yml` ours, `.csv`, `.json` WPILib's
/// @return what the format could not say
[[nodiscard]] Expected<std::vector<std::string>> write_map_file(
    const std::string& path, const TagMap& map, std::optional<MapFormat> format = std::nullopt,
    std::optional<FieldSize> field = std::nullopt);

}  // namespace fiducap
