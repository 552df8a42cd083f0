#include "daemon/urgency.hpp"

#include <sched.h>

namespace fiducap {

namespace {
constexpr int kPriority =
    10;  // any above none will do; lower than the kernel's own interrupt threads (50)
}  // namespace

void run_patiently() {
  const sched_param none{};
  (void)sched_setscheduler(0, SCHED_IDLE, &none);
}

bool run_urgently() {
  sched_param wanted{};
  wanted.sched_priority = kPriority;
  return sched_setscheduler(0, SCHED_RR | SCHED_RESET_ON_FORK, &wanted) == 0;
}

}  // namespace fiducap
