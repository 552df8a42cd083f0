#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "tools/terminal.hpp"

namespace fiducap {

struct MapArguments {
  std::string store;
  std::string file;                     ///< export: to; import: from
  std::optional<std::int64_t> version;  ///< show, export: nullopt is the newest
  std::optional<std::int64_t> before;   ///< diff: nullopt is the parent of `after`
  std::optional<std::int64_t> after;    ///< diff: nullopt is the newest
  std::optional<double> tag_size_m;     ///< import of WPILib files
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

}  // namespace fiducap
