#pragma once

#include "tools/replay/replay_inputs.hpp"

namespace fiducap {

/// `fiducap replay`. @return exit code
[[nodiscard]] int run_replay(const ReplayArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
