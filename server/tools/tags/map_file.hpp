#pragma once

#include <optional>
#include <string>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Reads a map file, its format by extension: `.yaml` `.yml` ours, `.csv` the recordings', `.json`
/// WPILib (which does not carry the size of its tags: `edge_m` must say it).
[[nodiscard]] Expected<TagMap> read_map_file(const std::string& path,
                                             std::optional<double> edge_m = std::nullopt);

/// Writes `.yaml` `.yml` or `.csv`.
[[nodiscard]] Expected<void> write_map_file(const std::string& path, const TagMap& map);

}  // namespace fiducap
