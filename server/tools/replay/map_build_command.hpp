#pragma once

#include <string>
#include <vector>

#include "tools/terminal.hpp"

namespace fiducap {

struct MapBuildArguments {
  std::vector<std::string> recordings;
  std::string out;    ///< A file: .yaml, .csv; empty: none.
  std::string store;  ///< A map store; empty: none.
  std::string config;
  std::string map;  ///< Tags whose places are known.
  std::string filter;
  std::string comment;
  std::vector<std::string> sets;
  bool json{false};
};

/// `fiducap map build`: one map of several recordings. @return exit code; fails when no recording
/// has given the map anything
[[nodiscard]] int run_map_build(const MapBuildArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
