#include "daemon/urgency.hpp"

#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <future>
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

/// How a thread runs after `run`, and whether it then loses its patience.
struct Ran {
  int before{};
  bool lost{};
  int after{};
  bool lost_at_end{};  ///< Of a thread that has ended.
};

Ran try_out(void (*run)()) {
  std::promise<pid_t> number;
  std::promise<void> done;
  std::jthread patient([&] {
    run();
    number.set_value(static_cast<pid_t>(::syscall(SYS_gettid)));
    done.get_future().wait();
  });
  const pid_t thread = number.get_future().get();
  Ran ran;
  ran.before = sched_getscheduler(thread);
  ran.lost = lose_patience(thread);
  ran.after = sched_getscheduler(thread);
  done.set_value();
  patient.join();
  ran.lost_at_end = lose_patience(thread);
  return ran;
}

TEST(Urgency, PatienceIsLostOnlyByWhoHasTheRight) {
  const Ran ran = try_out(run_patiently);
  EXPECT_EQ(ran.before, SCHED_IDLE);
  EXPECT_EQ(ran.after, ran.lost ? SCHED_OTHER : SCHED_IDLE);
  EXPECT_FALSE(ran.lost_at_end);
}

TEST(Urgency, PatienceForNowIsTakenWhereItCanBeLost) {
  const bool has_right = try_out(run_patiently).lost;
  const Ran ran = try_out(run_patiently_for_now);
  EXPECT_EQ(ran.before, has_right ? SCHED_IDLE : SCHED_OTHER);
  EXPECT_EQ(ran.after, SCHED_OTHER);
}

}  // namespace
}  // namespace fiducap
