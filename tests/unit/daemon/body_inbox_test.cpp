#include "daemon/bodies/body_reader.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

ImuSample imu_at(Instant at) {
  ImuSample sample;
  sample.sampled_at = at;
  return sample;
}

TEST(BodyInbox, GivesSamplesInOrderOfArrivalWithTheirTimeOfArrival) {
  BodyInbox inbox(2);
  ASSERT_TRUE(inbox.push(imu_at(ms(12)), ms(13)));
  ASSERT_TRUE(inbox.push(CornerFrame{0, ms(10), {}}, ms(14)));
  std::vector<Delivery> taken;
  ASSERT_TRUE(inbox.take(taken, {}));
  ASSERT_EQ(taken.size(), 2u);
  EXPECT_EQ(time_of(taken[0].sample), ms(12));
  EXPECT_EQ(time_of(taken[1].sample), ms(10));
  EXPECT_EQ(taken[1].arrived, ms(14));
}

TEST(BodyInbox, GivesTheRestAfterTheEndAndThenNothing) {
  BodyInbox inbox(2);
  ASSERT_TRUE(inbox.push(CornerFrame{0, ms(10), {}}, ms(14)));
  inbox.finish();
  std::vector<Delivery> taken;
  EXPECT_TRUE(inbox.take(taken, {}));
  EXPECT_FALSE(inbox.take(taken, {}));
  EXPECT_TRUE(taken.empty());
}

TEST(BodyInbox, DropsTheOldestImageWhenNobodyTakesThemAndNoImuReading) {
  BodyInbox inbox(2);
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(inbox.push(imu_at(ms(9 + 50 * i)), ms(9 + 50 * i)));
    ASSERT_TRUE(inbox.push(CornerFrame{0, ms(10 + 50 * i), {}}, ms(10 + 50 * i)));
  }
  EXPECT_EQ(inbox.images_dropped(), 3u);
  std::vector<Delivery> taken;
  ASSERT_TRUE(inbox.take(taken, {}));
  ASSERT_EQ(taken.size(), 7u);
  EXPECT_EQ(time_of(taken[4].sample), ms(160)) << "the oldest image that is left";
}

TEST(BodyInbox, ForgetsAllThatWaitsWhenImuReadingsPileUpThatNobodyTakes) {
  BodyInbox inbox(2);
  EXPECT_TRUE(inbox.push(CornerFrame{0, ms(1), {}}, ms(0)));
  const int all = static_cast<int>(BodyInbox::kMaxImu) + 5;
  for (int i = 0; i < all; ++i) ASSERT_TRUE(inbox.push(imu_at(ms(i)), ms(0)));
  EXPECT_EQ(inbox.overflows(), 1U);
  std::vector<Delivery> taken;
  ASSERT_TRUE(inbox.take(taken, {}));
  ASSERT_EQ(taken.size(), 5U) << "no gap inside of what is left";
  EXPECT_EQ(time_of(taken.front().sample), ms(all - 5));
}

TEST(BodyInbox, TakesNothingAfterItWasClosed) {
  BodyInbox inbox(2);
  inbox.close();
  EXPECT_FALSE(inbox.push(CornerFrame{0, ms(10), {}}, ms(14)));
  std::vector<Delivery> taken;
  EXPECT_FALSE(inbox.take(taken, {}));
}

TEST(BodyInbox, DoesNotWaitForSamplesWhenStopped) {
  BodyInbox inbox(2);
  std::stop_source stop;
  stop.request_stop();
  std::vector<Delivery> taken;
  EXPECT_FALSE(inbox.take(taken, stop.get_token()));
}

}  // namespace
}  // namespace fiducap
