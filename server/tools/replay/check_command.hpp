#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/recording/recording.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct CheckArguments {
  std::vector<std::string> recordings;
};

/// `fiducap check`: what is in a recording, and what is wrong with it. @return exit code
[[nodiscard]] int run_check(const CheckArguments& arguments, const Terminal& terminal);

/// Says what check_recording() finds on `terminal.err`.
/// @return Error with the likeliest cause when the recording is unusable
[[nodiscard]] Expected<void> require_usable(const RecordingInfo& info, const Terminal& terminal);

}  // namespace fiducap
