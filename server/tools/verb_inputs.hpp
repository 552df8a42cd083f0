#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/recording/recording.hpp"
#include "mapping/map_edit.hpp"
#include "pipeline/replay/recording_check.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

// What several verbs read.

/// Writes the findings of check_recording() to `terminal.err`.
/// @return the report; Error with the likeliest cause when the recording is unusable
[[nodiscard]] Expected<RecordingReport> require_usable(const RecordingInfo& info,
                                                       const Terminal& terminal);

/// Reads places of tags that were measured in the room: CSV with the header `id,x,y,z`, metres, one
/// tag a line; empty lines and those that begin with # are skipped.
/// @return Error with file, line, what was expected and what was found
[[nodiscard]] Expected<std::vector<MeasuredPlace>> read_measured_places(const std::string& file);

}  // namespace fiducap
