#pragma once

#include "base/expected.hpp"
#include "capture/recording/recording.hpp"
#include "pipeline/replay/recording_check.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

/// Says what check_recording() finds on `terminal.err`.
/// @return what was found; Error with the likeliest cause when the recording is unusable
[[nodiscard]] Expected<RecordingReport> require_usable(const RecordingInfo& info,
                                                       const Terminal& terminal);

}  // namespace fiducap
