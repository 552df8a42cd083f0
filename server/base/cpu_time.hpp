#pragma once

#include "base/time.hpp"

namespace fiducap {

/// CPU time this thread has used so far.
[[nodiscard]] Duration thread_cpu_time();

}  // namespace fiducap
