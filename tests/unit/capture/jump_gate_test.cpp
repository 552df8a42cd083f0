#include "capture/sample_merger.hpp"

#include <gmock/gmock.h>

#include "support/allocation_counter.hpp"
#include "unit/capture/sample_stamps.hpp"

namespace fiducap {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr int kImu = -1;
constexpr std::int64_t kFuture_ms = 3'900'000'000'000;

class JumpGateTest : public testing::Test {
 protected:
  static SensorSample sample(int sensor, std::int64_t ms) {
    const Instant at = instant_from_ns(ms * 1'000'000);
    if (sensor == kImu) return ImuSample{at, {0, 0, 0}, {0, 0, 9.81}};
    return CornerFrame{sensor, at, {}};
  }
  std::vector<std::int64_t> take(int sensor, std::int64_t ms) {
    return stamps_ms(gate_.take(sample(sensor, ms)));
  }
  void start() {
    take(kImu, 0);
    take(kImu, 5);
  }

  JumpGate gate_{seconds(1)};
};

TEST_F(JumpGateTest, HoldsTheFirstSampleUntilAnother) {
  EXPECT_THAT(take(kImu, 100), IsEmpty());
  EXPECT_THAT(take(0, 90), ElementsAre(100, 90));
  EXPECT_THAT(take(kImu, 105), ElementsAre(105)) << "nothing waits any more";
}

TEST_F(JumpGateTest, DropsAFirstStampOfTheFuture) {
  take(kImu, kFuture_ms);
  EXPECT_THAT(take(kImu, 5), IsEmpty()) << "the two disagree";
  EXPECT_THAT(take(kImu, 10), ElementsAre(5, 10));
  EXPECT_EQ(gate_.dropped(), 1u);
}

TEST_F(JumpGateTest, DropsALaterStampOfTheFuture) {
  start();
  for (const int sensor : {kImu, 0}) {
    take(sensor, 50);
    EXPECT_THAT(take(sensor, kFuture_ms), IsEmpty());
    EXPECT_THAT(take(sensor, 60), ElementsAre(60));
  }
  EXPECT_EQ(gate_.dropped(), 2u);
}

TEST_F(JumpGateTest, PassesOtherSensorsWhileOneIsHeld) {
  start();
  EXPECT_THAT(take(0, kFuture_ms), IsEmpty());
  EXPECT_THAT(take(kImu, 10), ElementsAre(10));
  EXPECT_THAT(take(1, 8), ElementsAre(8));
}

TEST_F(JumpGateTest, LosesNothingAfterAPauseOfAllSensors) {
  start();
  EXPECT_THAT(take(0, 60'000), IsEmpty());
  EXPECT_THAT(take(kImu, 60'002), ElementsAre(60'000, 60'002)) << "two sensors agree";
  EXPECT_THAT(take(kImu, 60'007), ElementsAre(60'007));
  EXPECT_EQ(gate_.dropped(), 0u);
}

TEST_F(JumpGateTest, DelaysASlowCameraByOneImage) {
  take(0, 0);
  EXPECT_THAT(take(0, 15'000), ElementsAre(0));
  EXPECT_THAT(take(0, 30'000), ElementsAre(15'000));
  EXPECT_EQ(gate_.dropped(), 0u);
}

TEST_F(JumpGateTest, PassesSensorsOfDifferentClocks) {
  take(kImu, 0);
  take(0, 5'000'000);
  EXPECT_THAT(take(kImu, 5), ElementsAre(0, 5));
  EXPECT_THAT(take(0, 5'000'050), ElementsAre(5'000'000, 5'000'050));
  EXPECT_THAT(take(kImu, 10), ElementsAre(10));
}

TEST_F(JumpGateTest, PassesASingleSampleButNoDoubtfulOneAtTheEnd) {
  take(0, 7);
  EXPECT_THAT(stamps_ms(gate_.finish()), ElementsAre(7));
  take(0, 57);
  take(0, kFuture_ms);
  EXPECT_THAT(stamps_ms(gate_.finish()), IsEmpty());
  EXPECT_EQ(gate_.dropped(), 1u);
}

TEST_F(JumpGateTest, AllocatesNothingPerSample) {
  start();
  const AllocationCounter allocations;
  for (std::int64_t t = 10; t < 10'000; t += 5)
    (void)gate_.take(sample(kImu, t % 500 == 0 ? kFuture_ms : t));
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(gate_.dropped(), 19u);
}

}  // namespace
}  // namespace fiducap
