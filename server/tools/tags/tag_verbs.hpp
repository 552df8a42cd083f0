#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/command_line.hpp"

namespace fiducap {

/// Of all verbs below `fiducap map` but `build`.
struct MapArguments {
  std::string store;
  std::string file;                     ///< export, backup: to; import: from
  std::optional<std::int64_t> version;  ///< show, export: nullopt is the newest; rollback, name
  std::optional<std::int64_t> before;   ///< diff: nullopt is the parent of `after`
  std::optional<std::int64_t> after;    ///< diff: nullopt is the newest
  std::string format;                   ///< export, import: empty is that of the file
  std::optional<double> tag_size_m;     ///< import of files without sizes; edit: of a new tag
  std::string family;                   ///< import of files without it; empty: tag36h11
  std::vector<double> field_m;          ///< export to WPILib: length, width; empty: as tags reach
  std::string name;                     ///< name
  std::string measured;                 ///< align: file with measured places
  std::vector<double> distance;         ///< align: two ids and metres
  double most_off_m{0.05};              ///< align
  std::vector<int> forget;              ///< edit: ids
  std::vector<int> quarantine;          ///< edit: ids
  std::vector<double> survey;           ///< edit: id, place, optionally attitude w x y z
  double sigma_m{0};                    ///< edit: of the survey
  std::string comment;                  ///< import, edit, align
  bool replaces{false};                 ///< backup: an existing file
  bool json{false};
};

/// `fiducap map export | import | log | diff | show | check | repair | backup`. @return exit code;
/// `check` fails when something is damaged
[[nodiscard]] int run_map_export(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_import(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_log(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_diff(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_show(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_check(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_repair(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_backup(const MapArguments& arguments, const Terminal& terminal);

/// `fiducap map rollback | name | align | edit`: changes a store that no server has open. Each but
/// `name` makes a version; earlier versions stay.
[[nodiscard]] int run_map_rollback(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_name(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_align(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_edit(const MapArguments& arguments, const Terminal& terminal);

struct MapVerb {
  CLI::App& verb;
  MapArguments& arguments;  ///< Its options write into these.
};

/// Adds a verb for a store. @param changes  the store, which no server may have open
MapVerb add_map_verb(CLI::App& map, ChosenVerb& chosen, const char* name, const char* what,
                     bool changes, const std::string& example,
                     int (*run)(const MapArguments&, const Terminal&));

}  // namespace fiducap
