#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <stdexcept>

#include "streaming/net/repeated_wait.hpp"

namespace fiducap::net {
namespace {

/// Ticks until it is destroyed; the second tick throws before the next wait.
class Ticker final : public RepeatedWait, public std::enable_shared_from_this<Ticker> {
 public:
  explicit Ticker(boost::asio::io_context& io) : timer_(io) {}
  void resume() override {
    if (waiting_) return;
    if (failures_to_resume > 0) {
      --failures_to_resume;
      throw std::bad_alloc();
    }
    timer_.expires_after(std::chrono::nanoseconds(1));
    timer_.async_wait([self = shared_from_this(), token = waiting_.begin()](auto) mutable {
      token.release();
      if (++self->ticks == 2) throw std::runtime_error("a defect");
      self->resume();
    });
  }

  int ticks{0};
  int failures_to_resume{0};

 private:
  boost::asio::steady_timer timer_;
  PendingWait waiting_;
};

TEST(RepeatedWait, LostWaitIsResumedAsSoonAsPossible) {
  boost::asio::io_context io;
  const auto ticker = std::make_shared<Ticker>(io);
  register_wait(io, ticker);
  ticker->resume();
  EXPECT_THROW(io.run(), std::runtime_error);
  io.restart();  // it may have run out of work
  ticker->failures_to_resume = 1;
  EXPECT_FALSE(resume_waits(io));
  EXPECT_TRUE(resume_waits(io));
  while (ticker->ticks < 5) ASSERT_EQ(io.run_one(), 1U);
}

TEST(RepeatedWait, RunningWaitIsKeptAndADestroyedOneForgotten) {
  boost::asio::io_context io;
  register_wait(io, std::make_shared<Ticker>(io));
  const auto ticker = std::make_shared<Ticker>(io);
  register_wait(io, ticker);
  ticker->resume();
  EXPECT_TRUE(resume_waits(io));
  EXPECT_EQ(io.run_one(), 1U);
  EXPECT_EQ(ticker->ticks, 1);
}

TEST(PendingWait, EndsWithItsTokenAndNotWithAReleasedOne) {
  PendingWait wait;
  EXPECT_FALSE(wait);
  {
    const auto token = wait.begin();
    EXPECT_TRUE(wait);
  }
  EXPECT_FALSE(wait);
  auto first = wait.begin();
  first.release();
  const auto second = wait.begin();
  first.release();
  EXPECT_TRUE(wait);
}

}  // namespace
}  // namespace fiducap::net
