#include "daemon/system.hpp"

#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <future>
#include <thread>

#include <gtest/gtest.h>

namespace fiducap {
namespace {

TEST(RealtimePriority, IsOfThisThreadAndNeedsPermission) {
  std::thread([] {
    const int before = sched_getscheduler(0);
    const bool permitted = set_realtime_priority();
    EXPECT_EQ(sched_getscheduler(0), permitted ? SCHED_RR | SCHED_RESET_ON_FORK : before);
    std::thread([] { EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER); }).join();
  }).join();
}

TEST(BackgroundPriority, IsOfThisThreadOnly) {
  std::thread([] {
    set_background_priority();
    EXPECT_EQ(sched_getscheduler(0), SCHED_IDLE);
  }).join();
  EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER);
}

/// Scheduling of a thread after `run`, and after an attempt to restore its priority.
struct Ran {
  int before{};
  bool lost{};
  int after{};
  bool lost_at_end{};  ///< Of a thread that has ended.
};

Ran try_out(void (*run)()) {
  std::promise<pid_t> number;
  std::promise<void> done;
  std::jthread background([&] {
    run();
    number.set_value(static_cast<pid_t>(::syscall(SYS_gettid)));
    done.get_future().wait();
  });
  const pid_t thread = number.get_future().get();
  Ran ran;
  ran.before = sched_getscheduler(thread);
  ran.lost = restore_normal_priority(thread);
  ran.after = sched_getscheduler(thread);
  done.set_value();
  background.join();
  ran.lost_at_end = restore_normal_priority(thread);
  return ran;
}

TEST(ThreadPriority, IsRestoredOnlyWithPermission) {
  const Ran ran = try_out(set_background_priority);
  EXPECT_EQ(ran.before, SCHED_IDLE);
  EXPECT_EQ(ran.after, ran.lost ? SCHED_OTHER : SCHED_IDLE);
  EXPECT_FALSE(ran.lost_at_end);
}

TEST(ThreadPriority, IsReversiblyLoweredOnlyWithPermission) {
  const bool is_permitted = try_out(set_background_priority).lost;
  const Ran ran = try_out(set_reversible_background_priority);
  EXPECT_EQ(ran.before, is_permitted ? SCHED_IDLE : SCHED_OTHER);
  EXPECT_EQ(ran.after, SCHED_OTHER);
}

}  // namespace
}  // namespace fiducap
