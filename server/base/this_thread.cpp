#include "base/this_thread.hpp"

#include <pthread.h>

#include <ctime>

namespace fiducap {

Duration thread_cpu_time() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return Duration{std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec};
}

void name_this_thread(std::string name) {
  constexpr std::size_t kLongest = 15;  // the kernel takes no more
  if (name.size() > kLongest) name.resize(kLongest);
  (void)::pthread_setname_np(::pthread_self(), name.c_str());
}

}  // namespace fiducap
