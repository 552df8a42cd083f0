#include "daemon/urgency.hpp"

#include <sched.h>

#include <thread>

#include <gtest/gtest.h>

namespace fiducap {
namespace {

TEST(Urgency, IsThisThreadsAloneAndChangesNothingWithoutTheRight) {
  std::thread([] {
    const int before = sched_getscheduler(0);
    const bool urgent = run_urgently();
    EXPECT_EQ(sched_getscheduler(0), urgent ? SCHED_RR | SCHED_RESET_ON_FORK : before);
    std::thread([] { EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER); }).join();
  }).join();
}

TEST(Urgency, PatienceIsThisThreadsAlone) {
  std::thread([] {
    run_patiently();
    EXPECT_EQ(sched_getscheduler(0), SCHED_IDLE);
  }).join();
  EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER);
}

}  // namespace
}  // namespace fiducap
