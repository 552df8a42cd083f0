#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "base/time.hpp"

/// Resources of this process and its threads, as the kernel accounts for them.
namespace fiducap {

[[nodiscard]] Duration thread_cpu_time();

/// A thread of this process, for other threads, while it lives.
struct ThreadHandle {
  pid_t number{};  ///< The kernel's.
  clockid_t clock{};

  /// CPU time that the thread has used; 0 after it has ended.
  [[nodiscard]] Duration cpu_time() const;
};
[[nodiscard]] ThreadHandle this_thread();

/// Sets the name that `top -H` and debuggers show for the calling thread: the first 15 bytes.
void name_this_thread(std::string name);

/// Open file descriptors of this process; empty when the kernel does not list them.
[[nodiscard]] std::vector<int> open_descriptors();

}  // namespace fiducap
