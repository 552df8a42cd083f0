#include "pipeline/imu_plausibility.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <utility>

#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class ImuFlowTest : public testing::Test {
 protected:
  std::optional<ImuFault> run(Duration how_long, Duration period = 5ms) {
    for (const Instant until = now_ + how_long; now_ < until; now_ += period) {
      ++tick_;
      if (repeats_ == 0 || tick_ % repeats_ == 0) value_ += 0.001;
      flow_.add({now_, {value_, 0, 0}, {0, 0, 9.81}});
    }
    return flow_.fault();
  }
  /// Readings with gaps between them.
  std::optional<ImuFault> run_with_gaps(int runs, Duration run_length, Duration gap) {
    for (int i = 0; i < runs; ++i) {
      run(run_length);
      now_ += gap;
    }
    return flow_.fault();
  }
  ImuFlow flow_{200};
  Instant now_{instant_from_ns(1'000'000'000)};
  int tick_{0};
  int repeats_{0};  ///< Every n-th reading is a new one; 0: all.
  double value_{0};
};

TEST_F(ImuFlowTest, JudgesTheRateAndRepeatedReadings) {
  struct Case {
    double configured_hz;
    Duration period;
    int repeats;
    std::optional<ImuFault> fault;
    const char* text;
  };
  for (const auto& [configured_hz, period, repeats, fault, text] :
       {Case{200, 5ms, 0, {}, ""},
        {200, 10ms, 0, {}, ""},
        {0, 100ms, 0, {}, ""},
        {200, 50ms, 0, ImuFault::kSlow, "gives 20 readings a second, 200 are configured"},
        {200, 5ms, 2, ImuFault::kRepeated, "50 % of the IMU's readings repeat the one before"}}) {
    flow_ = ImuFlow(configured_hz);
    repeats_ = repeats;
    EXPECT_EQ(run(60s, period), fault) << text;
    EXPECT_THAT(flow_.text(), HasSubstr(text));
    EXPECT_EQ(flow_.text().empty(), !fault);
  }
}

TEST_F(ImuFlowTest, JudgesFrequentHolesButNotPauses) {
  EXPECT_FALSE(run_with_gaps(10, 4s, 120ms)) << "rare";
  flow_ = ImuFlow(200);
  EXPECT_FALSE(run_with_gaps(15, 1s, 2s)) << "pauses";
  flow_ = ImuFlow(200);
  EXPECT_EQ(run_with_gaps(15, 1s, 120ms), ImuFault::kHoles);
  EXPECT_THAT(flow_.text(), HasSubstr("of up to 125 ms"));
}

TEST_F(ImuFlowTest, FrozenReadingsAreReported) {
  run(10s);
  repeats_ = 1'000'000'000;
  EXPECT_EQ(run(16s), ImuFault::kFrozen);
  EXPECT_THAT(flow_.text(), HasSubstr("frozen"));
}

TEST_F(ImuFlowTest, OneBadWindowIsNoFaultAndThreeGoodOnesEndOne) {
  run(6s);
  run(5s, 50ms);
  EXPECT_FALSE(run(20s));
  EXPECT_TRUE(run(16s, 50ms));
  EXPECT_TRUE(run(12s));
  EXPECT_FALSE(run(10s));
}

class ImuPlausibilityTest : public testing::Test {
 protected:
  /// @return the faults found within this time
  std::vector<ImuFault> run(double seconds) {
    std::vector<ImuFault> found;
    for (const int end = tick_ + static_cast<int>(seconds * 200); tick_ < end; ++tick_) {
      plausibility_.add({instant_from_ns(std::int64_t{tick_} * 5'000'000),
                         {0, 0.1 * std::cos(0.01 * tick_), 0},
                         force_scale_ * Eigen::Vector3d(0.3, 9.8, 0.2)});
      const ImuFaults before = std::exchange(faults_, plausibility_.faults(has_degrees_));
      for (const ImuFault fault : faults_to_report(before, faults_)) found.push_back(fault);
      all_clears_ += before != faults_ && faults_ == ImuFaults{} ? 1 : 0;
    }
    return found;
  }

  ImuPlausibility plausibility_;
  int tick_{0};
  double force_scale_{1};
  bool has_degrees_{false};
  ImuFaults faults_{};
  int all_clears_{0};
};

TEST_F(ImuPlausibilityTest, ASoundImuHasNoFault) { EXPECT_THAT(run(60), IsEmpty()); }

TEST_F(ImuPlausibilityTest, DistinguishesWrongForces) {
  for (const auto& [scale, fault] : {std::pair(1 / 9.80665, ImuFault::kForceInG),
                                     std::pair(1000 / 9.80665, ImuFault::kForceInMilliG),
                                     std::pair(0.005, ImuFault::kForceWithoutGravity),
                                     std::pair(0.5, ImuFault::kForceUnlikely)}) {
    plausibility_ = {};
    force_scale_ = scale;
    EXPECT_THAT(run(10), ElementsAre(fault));
  }
  EXPECT_TRUE(is_fatal(ImuFault::kForceInG));
}

TEST_F(ImuPlausibilityTest, ReportsThatAnImuWasRepaired) {
  force_scale_ = 1 / 9.80665;
  has_degrees_ = true;
  EXPECT_THAT(run(60),
              UnorderedElementsAre(ImuFault::kForceInG, ImuFault::kRateInDegreesPerSecond));
  EXPECT_EQ(all_clears_, 0);
  force_scale_ = 1;
  EXPECT_THAT(run(60), ElementsAre(ImuFault::kRateInDegreesPerSecond)) << "the other fault is left";
  EXPECT_EQ(all_clears_, 0);
  has_degrees_ = false;
  EXPECT_THAT(run(60), IsEmpty());
  EXPECT_EQ(all_clears_, 1);
}

TEST_F(ImuPlausibilityTest, TestsAgainAfterAPause) {
  EXPECT_THAT(run(30), IsEmpty());
  force_scale_ = 1 / 9.80665;
  EXPECT_THAT(run(30), IsEmpty()) << "the test has ended";
  tick_ += 400;  // it may be another IMU
  EXPECT_THAT(run(30), ElementsAre(ImuFault::kForceInG));
}

TEST_F(ImuPlausibilityTest, ReportsAFaultOfTheFlowOnce) {
  plausibility_ = ImuPlausibility(2000);  // ten times the true rate
  EXPECT_THAT(run(16), ElementsAre(ImuFault::kSlow));
  EXPECT_THAT(plausibility_.text(ImuFault::kSlow),
              HasSubstr("gives 200 readings a second, 2000 are configured"));
  EXPECT_FALSE(is_fatal(ImuFault::kSlow));
  EXPECT_THAT(run(30), IsEmpty());
  EXPECT_EQ(all_clears_, 0);
}

TEST_F(ImuPlausibilityTest, AllocatesNothing) {
  const AllocationCounter allocations;
  for (int i = 0; i < 4000; ++i)
    plausibility_.add({instant_from_ns(std::int64_t{i} * 5'000'000), {0, 0, 0}, {0, 0, 9.81}});
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap
