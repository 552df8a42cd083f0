#pragma once

#include "tools/terminal.hpp"

namespace fiducap {

/// Reads the arguments of `fiducap` and runs the verb. This is the only place that knows the words
/// of the command line.
/// @return exit code: 0 done, 1 failed, 2 wrong usage
[[nodiscard]] int run_command_line(int argc, const char* const* argv, const Terminal& terminal);

}  // namespace fiducap
