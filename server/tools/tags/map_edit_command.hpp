#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/terminal.hpp"

namespace fiducap {

struct MapEditArguments {
  std::string store;
  std::int64_t version{};        ///< rollback, name
  std::string name;              ///< name
  std::string measured;          ///< align: file with measured places
  std::vector<double> distance;  ///< align: two ids and metres
  double most_off_m{0.05};       ///< align
  std::vector<int> forget;       ///< edit: ids
  std::vector<int> quarantine;   ///< edit: ids
  std::vector<double> survey;    ///< edit: id, place, and maybe attitude w x y z
  double sigma_m{0};             ///< edit: of the survey
  double tag_size_m{0};          ///< edit: of a surveyed tag that is new
  std::string comment;           ///< edit, align
  bool json{false};
};

/// `fiducap map rollback | name | align | edit`: by hand, into a store that no server has open. The
/// map of before stays; each but `name` makes a version.
[[nodiscard]] int run_map_rollback(const MapEditArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_name(const MapEditArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_align(const MapEditArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_map_edit(const MapEditArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
