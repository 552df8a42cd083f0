#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct MapArguments {
  std::string store;
  std::string file;                     ///< export: to; import: from
  std::optional<std::int64_t> version;  ///< show, export: nullopt is the newest
  std::optional<std::int64_t> before;   ///< diff: nullopt is the parent of `after`
  std::optional<std::int64_t> after;    ///< diff: nullopt is the newest
  std::string format;                   ///< export, import: empty is what the file is
  std::optional<double> tag_size_m;     ///< import of files without sizes
  std::string family;                   ///< import of files without it; empty: tag36h11
  std::vector<double> field_m;          ///< export to WPILib: length, width; empty: as tags reach
  std::string comment;
  bool json{false};
};

enum class MapOrigin {
  kFile,   ///< The next version follows the newest one.
  kStore,  ///< It is a version of this store, and the parent of what it becomes.
};

/// Stores the map as the next version; the store is made when there is none. Says what it passed
/// over. @return it as stored
[[nodiscard]] Expected<TagMap> store_next_version(const std::string& store, TagMap map,
                                                  const std::string& comment,
                                                  const Terminal& terminal,
                                                  MapOrigin origin = MapOrigin::kFile);

/// What a script wants to know of a version that was stored or written.
[[nodiscard]] std::string version_json(const std::string& file, const TagMap& map);

/// The newest version that is as it was stored, or the given one; says what it passed over.
[[nodiscard]] Expected<TagMap> stored_version(const std::string& store,
                                              std::optional<std::int64_t> version,
                                              const Terminal& terminal);

/// `fiducap map export | import | log | diff | show | check | repair`. @return exit code; `check`
/// fails when something is damaged
[[nodiscard]] int run_map_export(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_import(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_log(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_diff(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_show(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_check(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_repair(const MapArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
