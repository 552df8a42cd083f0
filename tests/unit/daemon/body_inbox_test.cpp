#include "daemon/bodies/body_inbox.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

ImuSample imu_at(Instant at) {
  ImuSample sample;
  sample.sampled_at = at;
  return sample;
}

MergerConfig small() {
  MergerConfig config;
  config.has_imu = false;
  config.max_images = 2;
  return config;
}

TEST(BodyInbox, RemembersWhenAnImageArrived) {
  BodyInbox inbox(small());
  ASSERT_TRUE(inbox.push(CornerFrame{0, ms(10), {}}, ms(14)));
  inbox.finish();
  const auto delivery = inbox.pop({});
  ASSERT_TRUE(delivery.has_value());
  EXPECT_EQ(time_of(delivery->sample), ms(10));
  EXPECT_EQ(delivery->arrived, ms(14));
}

TEST(BodyInbox, RemembersTheArrivalOfAnImageWhoseClockWasShifted) {
  BodyInbox inbox(small());
  inbox.set_clock_shift(0, std::chrono::milliseconds(-3));
  ASSERT_TRUE(inbox.push(CornerFrame{0, ms(10), {}}, ms(14)));
  inbox.finish();
  const auto delivery = inbox.pop({});
  ASSERT_TRUE(delivery.has_value());
  EXPECT_EQ(time_of(delivery->sample), ms(7));
  EXPECT_EQ(delivery->arrived, ms(14));
}

TEST(BodyInbox, GivesTheRestAfterTheEndAndThenNothing) {
  BodyInbox inbox(small());
  ASSERT_TRUE(inbox.push(CornerFrame{0, ms(10), {}}, ms(14)));
  ASSERT_TRUE(inbox.push(CornerFrame{0, ms(60), {}}, ms(64)));
  inbox.finish();
  EXPECT_TRUE(inbox.pop({}).has_value());
  EXPECT_TRUE(inbox.pop({}).has_value());
  EXPECT_FALSE(inbox.pop({}).has_value());
}

TEST(BodyInbox, DropsTheOldestImageWhenNobodyFetchesThem) {
  BodyInbox inbox(small());
  for (int i = 0; i < 5; ++i)
    ASSERT_TRUE(inbox.push(CornerFrame{0, ms(10 + 50 * i), {}}, ms(10 + 50 * i)));
  inbox.finish();
  EXPECT_EQ(inbox.statistics().images_dropped, 3u);
  EXPECT_EQ(time_of(inbox.pop({})->sample), ms(160));
}

TEST(BodyInbox, RefusesImuReadingsThatNobodyFetchesInsteadOfDroppingThem) {
  MergerConfig config;
  config.max_imu = 10;
  BodyInbox inbox(config);
  int taken = 0;
  while (taken < 100 && inbox.push(imu_at(ms(taken)), ms(taken))) ++taken;
  EXPECT_EQ(taken, 10);
}

TEST(BodyInbox, TakesNothingAfterItWasClosed) {
  BodyInbox inbox(small());
  inbox.close();
  EXPECT_FALSE(inbox.push(CornerFrame{0, ms(10), {}}, ms(14)));
  EXPECT_FALSE(inbox.pop({}).has_value());
}

TEST(BodyInbox, DoesNotWaitForSamplesWhenStopped) {
  BodyInbox inbox(small());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(inbox.pop(stop.get_token()).has_value());
}

}  // namespace
}  // namespace fiducap
