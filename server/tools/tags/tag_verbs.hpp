#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/terminal.hpp"

namespace fiducap {

struct MapArguments {
  std::string store;
  std::string file;                     ///< export: to; import: from
  std::optional<std::int64_t> version;  ///< show, export: nullopt is the newest
  std::optional<std::int64_t> before;   ///< diff: nullopt is the parent of `after`
  std::optional<std::int64_t> after;    ///< diff: nullopt is the newest
  std::string format;                   ///< export, import: empty is that of the file
  std::optional<double> tag_size_m;     ///< import of files without sizes
  std::string family;                   ///< import of files without it; empty: tag36h11
  std::vector<double> field_m;          ///< export to WPILib: length, width; empty: as tags reach
  std::string comment;
  bool json{false};
};

/// `fiducap map export | import | log | diff | show | check | repair`. @return exit code; `check`
/// fails when something is damaged
[[nodiscard]] int run_map_export(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_import(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_log(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_diff(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_show(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_check(const MapArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_repair(const MapArguments& arguments, const Terminal& terminal);

struct MapEditArguments {
  std::string store;
  std::int64_t version{};        ///< rollback, name
  std::string name;              ///< name
  std::string measured;          ///< align: file with measured places
  std::vector<double> distance;  ///< align: two ids and metres
  double most_off_m{0.05};       ///< align
  std::vector<int> forget;       ///< edit: ids
  std::vector<int> quarantine;   ///< edit: ids
  std::vector<double> survey;    ///< edit: id, place, optionally attitude w x y z
  double sigma_m{0};             ///< edit: of the survey
  double tag_size_m{0};          ///< edit: of a surveyed tag that is new
  std::string comment;           ///< edit, align
  bool json{false};
};

/// `fiducap map rollback | name | align | edit`: changes a store that no server has open. Each but
/// `name` makes a version; earlier versions stay.
[[nodiscard]] int run_map_rollback(const MapEditArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_name(const MapEditArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_align(const MapEditArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_edit(const MapEditArguments& arguments, const Terminal& terminal);

struct TagSheetArguments {
  std::string ids{"0-11"};
  std::string family{"tag36h11"};
  std::string paper{"a4"};
  std::string out{"tags.pdf"};
  double size_mm{160};
  bool json{false};
};

/// `fiducap tags sheet`. @return exit code
[[nodiscard]] int run_tag_sheet(const TagSheetArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
