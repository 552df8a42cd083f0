#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/map_alignment.hpp"

namespace fiducap {

/// Reads places of tags that were measured in the room: CSV with the header `id,x,y,z`, metres, one
/// tag a line; empty lines and those that begin with # are passed over.
/// @return Error with file, line, what was expected and what came
[[nodiscard]] Expected<std::vector<MeasuredPlace>> read_measured_places(const std::string& file);

}  // namespace fiducap
