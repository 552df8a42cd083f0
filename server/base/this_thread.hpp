#pragma once

#include <string>

#include "base/time.hpp"

namespace fiducap {

/// CPU time this thread has used so far.
[[nodiscard]] Duration thread_cpu_time();

/// What `top -H` and a debugger call this thread: the first 15 bytes.
void name_this_thread(std::string name);

}  // namespace fiducap
