#include "daemon/urgency.hpp"

#include <sched.h>
#include <sys/resource.h>

namespace fiducap {

namespace {
constexpr int kPriority =
    10;  // any above none will do; lower than the kernel's own interrupt threads (50)
}  // namespace

void run_patiently() {
  const sched_param none{};
  (void)sched_setscheduler(0, SCHED_IDLE, &none);
}

void run_patiently_for_now() {
  const int nice = getpriority(PRIO_PROCESS, 0);
  constexpr int kLast = 19;
  const bool may_come_back = nice < kLast && setpriority(PRIO_PROCESS, 0, nice + 1) == 0 &&
                             setpriority(PRIO_PROCESS, 0, nice) == 0;
  if (may_come_back) run_patiently();
}

bool lose_patience(pid_t thread) {
  const sched_param none{};
  return sched_setscheduler(thread, SCHED_OTHER, &none) == 0;
}

bool run_urgently() {
  sched_param wanted{};
  wanted.sched_priority = kPriority;
  return sched_setscheduler(0, SCHED_RR | SCHED_RESET_ON_FORK, &wanted) == 0;
}

}  // namespace fiducap
