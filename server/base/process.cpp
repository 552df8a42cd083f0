#include "base/process.hpp"

#include <dirent.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <charconv>
#include <ctime>
#include <memory>
#include <string_view>

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
  constexpr std::size_t kLongestName = 15;  // the kernel's limit
  if (name.size() > kLongestName) name.resize(kLongestName);
  (void)::pthread_setname_np(::pthread_self(), name.c_str());
}

/// Without std::filesystem, whose iterators end the process when there is no memory.
std::vector<int> open_descriptors() {
  std::vector<int> all;
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir("/proc/self/fd"), &::closedir);
  if (!folder) return all;
  while (const dirent* entry = ::readdir(folder.get())) {
    const std::string_view name = entry->d_name;
    int descriptor = -1;
    std::from_chars(name.data(), name.data() + name.size(), descriptor);
    if (descriptor >= 0 && descriptor != ::dirfd(folder.get())) all.push_back(descriptor);
  }
  return all;
}

}  // namespace fiducap
