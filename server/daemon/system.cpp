#include "daemon/system.hpp"

#include <ctime>
#include <mutex>

#include <sched.h>
#include <sys/resource.h>

namespace fiducap {
namespace {

std::int64_t read_ns(clockid_t id) {
  timespec t{};
  clock_gettime(id, &t);
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

constexpr int kPriority = 10;  // below the kernel's interrupt threads (50)

}  // namespace

Instant SystemClock::now() const { return instant_from_ns(read_ns(CLOCK_MONOTONIC)); }

bool SystemClock::wait_until(Instant at, std::stop_token stop) const {
  // libstdc++'s steady_clock is CLOCK_MONOTONIC, so the numbers are the same.
  const std::chrono::steady_clock::time_point until{at.time_since_epoch()};
  std::mutex mine;
  std::unique_lock lock(mine);
  never_.wait_until(lock, stop, until, [] { return false; });
  return !stop.stop_requested();
}

Duration utc_offset() {
  const std::int64_t before = read_ns(CLOCK_MONOTONIC);
  const std::int64_t utc = read_ns(CLOCK_REALTIME);
  const std::int64_t after = read_ns(CLOCK_MONOTONIC);
  return Duration{utc - before - (after - before) / 2};
}

std::int64_t utc_now_ns() { return read_ns(CLOCK_REALTIME); }

void set_background_priority() {
  const sched_param none{};
  (void)sched_setscheduler(0, SCHED_IDLE, &none);
}

void set_reversible_background_priority() {
  const int nice = getpriority(PRIO_PROCESS, 0);
  constexpr int kLast = 19;
  const bool may_come_back = nice < kLast && setpriority(PRIO_PROCESS, 0, nice + 1) == 0 &&
                             setpriority(PRIO_PROCESS, 0, nice) == 0;
  if (may_come_back) set_background_priority();
}

bool restore_normal_priority(pid_t thread) {
  const sched_param none{};
  return sched_setscheduler(thread, SCHED_OTHER, &none) == 0;
}

bool set_realtime_priority() {
  sched_param wanted{};
  wanted.sched_priority = kPriority;
  return sched_setscheduler(0, SCHED_RR | SCHED_RESET_ON_FORK, &wanted) == 0;
}

}  // namespace fiducap
