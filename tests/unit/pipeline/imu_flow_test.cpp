#include "pipeline/imu_plausibility.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class ImuFlowTest : public testing::Test {
 protected:
  void run(Duration how_long, Duration period = 5ms) {
    for (const Instant until = now_ + how_long; now_ < until; now_ += period) add();
  }
  void add() {
    ++tick_;
    if (repeats_ == 0 || tick_ % repeats_ == 0) value_ += 0.001;
    flow_.add({now_, {value_, 0, 0}, {0, 0, 9.81}});
  }
  ImuFlow flow_{200};
  Instant now_{instant_from_ns(1'000'000'000)};
  int tick_{0};
  int repeats_{0};
  double value_{0};
};

TEST_F(ImuFlowTest, AGoodImuIsLeftAlone) {
  run(60s);
  EXPECT_FALSE(flow_.fault());
  EXPECT_EQ(flow_.text(), "");
}

TEST_F(ImuFlowTest, ATenthOfItsRateIsSaidWithBothRates) {
  run(16s, 50ms);
  EXPECT_EQ(flow_.fault(), FlowFault::kSlow);
  EXPECT_THAT(flow_.text(), HasSubstr("gives 20 readings a second, 200 are configured"));
}

TEST_F(ImuFlowTest, HalfTheRateIsNoFault) {
  run(30s, 10ms);
  EXPECT_FALSE(flow_.fault());
}

TEST_F(ImuFlowTest, HolesAreSaidWithTheLongest) {
  for (int i = 0; i < 15; ++i) {
    run(1s);
    now_ += 120ms;
  }
  EXPECT_EQ(flow_.fault(), FlowFault::kHoles);
  EXPECT_THAT(flow_.text(), HasSubstr("of up to 125 ms"));
}

TEST_F(ImuFlowTest, AHoleNowAndThenIsNoFault) {
  for (int i = 0; i < 10; ++i) {
    run(4s);
    now_ += 120ms;
  }
  EXPECT_FALSE(flow_.fault());
}

TEST_F(ImuFlowTest, FrozenReadingsAreSaid) {
  run(10s);
  repeats_ = 1'000'000'000;
  run(16s);
  EXPECT_EQ(flow_.fault(), FlowFault::kFrozen);
  EXPECT_THAT(flow_.text(), HasSubstr("frozen"));
}

TEST_F(ImuFlowTest, ReadingsThatComeTwiceAreSaid) {
  repeats_ = 2;
  run(16s);
  EXPECT_EQ(flow_.fault(), FlowFault::kRepeated);
  EXPECT_THAT(flow_.text(), HasSubstr("50 % of the IMU's readings repeat the one before"));
}

TEST_F(ImuFlowTest, OneBadWindowIsNoFaultAndThreeGoodOnesEndOne) {
  run(6s);
  run(5s, 50ms);
  run(20s);
  EXPECT_FALSE(flow_.fault());
  run(16s, 50ms);
  EXPECT_TRUE(flow_.fault());
  run(12s);
  EXPECT_TRUE(flow_.fault());
  run(10s);
  EXPECT_FALSE(flow_.fault());
}

TEST_F(ImuFlowTest, APauseIsNoHole) {
  for (int i = 0; i < 15; ++i) {
    run(1s);
    now_ += 2s;
  }
  EXPECT_FALSE(flow_.fault());
}

TEST_F(ImuFlowTest, WithoutAPromisedRateNothingIsJudged) {
  flow_ = ImuFlow(0);
  run(30s, 100ms);
  EXPECT_FALSE(flow_.fault());
}

TEST_F(ImuFlowTest, AllocatesNothing) {
  const AllocationCounter allocations;
  run(20s, 50ms);
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap
