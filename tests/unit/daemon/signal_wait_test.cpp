#include "daemon/stream_loop.hpp"

#include <gtest/gtest.h>

#include <csignal>

#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

class SignalWaitTest : public testing::Test {
 protected:
  /// @return number of stops by one SIGTERM
  int told_by_a_signal() {
    told_ = 0;
    std::raise(SIGTERM);
    io_.restart();
    while (told_ == 0 && io_.run_one() > 0) {
    }
    return told_;
  }

  int told_{0};
  boost::asio::io_context io_;
  std::shared_ptr<SignalWait> wait_ = std::make_shared<SignalWait>(io_, [this] { ++told_; });
};

TEST_F(SignalWaitTest, HearsEverySignal) {
  wait_->resume();
  wait_->resume();  // waits already
  EXPECT_EQ(told_by_a_signal(), 1);
  EXPECT_EQ(told_by_a_signal(), 1);
}

TEST_F(SignalWaitTest, IsTakenUpAgainWhenThereWasNoMemoryToWait) {
  net::register_wait(io_, wait_);
  AllocationFault::reach_this_thread();
  bool has_failed = true;
  int failures = 0;
  for (int nth = 1; has_failed; ++nth) {
    AllocationFault::arm(nth);
    try {
      wait_->resume();
    } catch (const std::bad_alloc&) {
      ++failures;
    }
    has_failed = AllocationFault::disarm();
  }
  EXPECT_GT(failures, 0);
  EXPECT_TRUE(net::resume_waits(io_));
  EXPECT_EQ(told_by_a_signal(), 1);
}

}  // namespace
}  // namespace fiducap
