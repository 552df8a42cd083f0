#pragma once

#include <condition_variable>

#include <sys/types.h>
#include <unistd.h>

#include "base/time.hpp"

namespace fiducap {

/// Real time: CLOCK_MONOTONIC. One for the whole process; any thread may wait on it.
class SystemClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const override;
  [[nodiscard]] bool wait_until(Instant at, std::stop_token stop) const override;

 private:
  mutable std::condition_variable_any never_;  // only a stop request wakes a wait early
};

/// Closes a file or a socket. @param number  negative: there is none
class Descriptor final {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int number() const { return number_; }

 private:
  int number_;
};

/// UTC = server time + this, measured now; changes when the wall clock is corrected.
[[nodiscard]] Duration utc_offset();
[[nodiscard]] std::int64_t utc_now_ns();

/// Round-robin priority for the calling thread (not for threads it starts), so that frames do not
/// wait for filters or detectors when all cores are busy. The kernel limits it to 95 % of a core.
/// @return false: not permitted (root, CAP_SYS_NICE, or RLIMIT_RTPRIO as in
/// deploy/fiducapd.service), nothing has changed
bool set_realtime_priority();

/// Idle priority (SCHED_IDLE) for the calling thread and threads it starts, for long work without a
/// deadline. With nice 10 instead, the bodies' 99 % latency grows by half while a map is refined.
/// Makes little progress while all cores are busy.
void set_background_priority();
/// The same if restore_normal_priority() will be permitted; else almost no change.
void set_reversible_background_priority();
/// @param thread  the kernel's number of a thread of this process
/// @return false: not permitted (root, CAP_SYS_NICE, RLIMIT_NICE), or it has ended
bool restore_normal_priority(pid_t thread);

}  // namespace fiducap
