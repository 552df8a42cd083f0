#include "base/this_thread.hpp"

#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <ctime>

namespace fiducap {

namespace {
Duration time_on(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return Duration{std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec};
}
}  // namespace

Duration thread_cpu_time() { return time_on(CLOCK_THREAD_CPUTIME_ID); }

Duration ThreadHandle::cpu_time() const { return time_on(clock); }

ThreadHandle this_thread() {
  ThreadHandle handle{static_cast<pid_t>(::syscall(SYS_gettid)), {}};
  pthread_getcpuclockid(pthread_self(), &handle.clock);
  return handle;
}

void name_this_thread(std::string name) {
  constexpr std::size_t kLongest = 15;  // the kernel takes no more
  if (name.size() > kLongest) name.resize(kLongest);
  (void)::pthread_setname_np(::pthread_self(), name.c_str());
}

}  // namespace fiducap
