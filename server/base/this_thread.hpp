#pragma once

#include <sys/types.h>

#include <string>

#include "base/time.hpp"

namespace fiducap {

/// CPU time this thread has used so far.
[[nodiscard]] Duration thread_cpu_time();

/// A thread of this process as others see it, while it lives.
struct ThreadHandle {
  pid_t number{};  ///< The kernel's.
  clockid_t clock{};

  /// CPU time that it has used so far; 0: it has ended.
  [[nodiscard]] Duration cpu_time() const;
};
[[nodiscard]] ThreadHandle this_thread();

/// What `top -H` and a debugger call this thread: the first 15 bytes.
void name_this_thread(std::string name);

}  // namespace fiducap
