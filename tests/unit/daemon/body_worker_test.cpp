#include "body_worker_fixture.hpp"
#include "daemon/bodies/body_reader.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;

TEST_F(BodyWorkerTest, GivesTheFilterSamplesInOrder) {
  build(
      {imu_at(ms(1000)), imu_at(ms(1005)), imu_at(ms(1010)), frame_at(ms(1004)), imu_at(ms(1015))});
  run();
  EXPECT_THAT(log_.propagated, ElementsAre(ms(1000), ms(1005), ms(1010), ms(1015)));
  ASSERT_EQ(log_.updated.size(), 1u);
  EXPECT_EQ(log_.updated[0].exposed_at, ms(1004));
  ASSERT_EQ(log_.updated[0].tags.size(), 1u);
  EXPECT_EQ(log_.updated[0].tags[0].tag_id, 4);
}

TEST_F(BodyWorkerTest, GivesTheFilterSeenTagsOfTheMap) {
  start_.tags = {{known_tag(4), TagState::kCalibrated, 0, 0, 0, 0},
                 {known_tag(9), TagState::kCalibrated, 0, 0, 0, 0}};
  run({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002), {4, 5})});
  ASSERT_EQ(log_.known.size(), 1u);
  ASSERT_EQ(log_.known[0].size(), 1u);
  EXPECT_EQ(log_.known[0][0].tag_id, 4);
}

/// With an IMU at 200 Hz.
std::vector<SensorSample> images_at_20_hz(int images, const std::vector<int>& ids) {
  std::vector<SensorSample> samples;
  for (int k = 0; k < images; ++k) {
    for (int i = 0; i < 10; ++i) samples.push_back(imu_at(ms(1000 + 50 * k + 5 * i)));
    samples.push_back(frame_at(ms(1000 + 50 * k + 42), ids));
  }
  return samples;
}

TEST_F(BodyWorkerTest, JoinsItsSources) {
  std::vector<BodySource> sources;
  sources.push_back({giving({frame_at(ms(1002))}), "camera 0"});
  sources.push_back({giving({imu_at(ms(1000)), imu_at(ms(1005))}), "IMU", false});
  build(std::move(sources));
  ASSERT_EQ(worker_->sources(), 2u);
  worker_->read(1, {});
  worker_->read(0, {});
  worker_->work({});
  EXPECT_THAT(log_.propagated, ElementsAre(ms(1000), ms(1005)));
  EXPECT_EQ(log_.updated.size(), 1u);
  EXPECT_FALSE(worker_->reading(0));
  EXPECT_FALSE(worker_->reading(1));
}

TEST_F(BodyWorkerTest, EndsWhenNoSourceGivesImages) {
  std::vector<BodySource> sources;
  sources.push_back({giving({frame_at(ms(1002))}), "camera 0"});
  sources.push_back({giving({frame_at(ms(1004))}), "camera 1"});
  sources.push_back({made([](int turn) { return imu_at(ms(1000 + 5 * turn)); }), "IMU", false});
  build(std::move(sources));
  worker_->read(0, {});
  EXPECT_FALSE(worker_->pulse().ended);
  worker_->read(1, {});
  worker_->read(2, {});  // returns: its samples are refused
  worker_->work({});
  EXPECT_TRUE(worker_->pulse().ended);
}

TEST_F(BodyWorkerTest, UsesAllSamplesBeforeADeviceFails) {
  build(giving(one_image(), 0, Error{ErrorCode::kUnavailable, "unplugged", "/dev/video0"}));
  run();
  EXPECT_EQ(log_.updated.size(), 1u);
  EXPECT_EQ(pose_at(ms(1006)).state, BodyState::kLost);
}

TEST_F(BodyWorkerTest, IgnoresImagesOfAnUnknownCamera) {
  CornerFrame second = frame_at(ms(1002));
  second.camera = 1;
  run({imu_at(ms(1000)), second, imu_at(ms(1005))});
  EXPECT_TRUE(log_.updated.empty());
}

TEST_F(BodyWorkerTest, KeepsStatistics) {
  run({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002), {4, 5}), imu_at(ms(1010)),
       frame_at(ms(1008), {})});
  const BodyStatistics done = worker_->statistics();
  EXPECT_EQ(done.pipeline.frames, 2u);
  EXPECT_EQ(done.pipeline.frames_with_pose, 0u) << "poses of a new room are withheld";
  EXPECT_EQ(done.pipeline.tags_used, 2u);
  EXPECT_EQ(done.pipeline.imu_samples, 3u);
  EXPECT_GT(done.pipeline.update_cpu.count(), 0);
  EXPECT_THAT(done.text(),
              testing::HasSubstr("2 frames (0 with pose), 2 tags used, 3 IMU samples"));
  EXPECT_EQ(worker_->learned().size(), 1u);
}

TEST_F(BodyWorkerTest, SkipsAnOldImageWhenThereIsANewerOne) {
  build_three_images();
  worker_->read(0, {});
  clock_.advance(std::chrono::milliseconds(500));  // the worker gets no time meanwhile
  worker_->work({});
  ASSERT_EQ(log_.updated.size(), 1U);
  EXPECT_EQ(log_.updated.front().exposed_at, ms(1242)) << "the newest";
  EXPECT_EQ(log_.propagated.size(), 4U) << "every IMU reading is used";
  EXPECT_EQ(worker_->statistics().images_dropped, 2U);
}

TEST_F(BodyWorkerTest, KeepsTheBodyWhenTheServerStops) {
  build(one_image());
  std::stop_source stop;
  stop.request_stop();
  worker_->read(0, stop.get_token());
  worker_->work(stop.get_token());
  EXPECT_TRUE(log_.updated.empty());
  EXPECT_EQ(pose_at(ms(1006)).state, BodyState::kSearching);
}

TEST_F(BodyWorkerTest, AllocatesNothingPerSampleAfterWarmUp) {
  constexpr int kImages = 300;
  constexpr int kWarm = 150;
  constexpr int kCounted = kImages - 2 * kAhead;  // the end of the source is a line in the log
  start_.tags = {{known_tag(4), TagState::kCalibrated, 0, 0, 0, 0}};
  std::atomic<int> images_done{0};
  build(paced(images_at_20_hz(kImages, {4, 5, 6}), images_done));
  filter_->quiet = true;
  filter_->beliefs = {{known_tag(5), 100, ms(0), ms(1002)}};
  std::uint64_t at_warm = 0;
  std::uint64_t at_end = 0;
  filter_->on_image = [&](int done) {
    if (done == kWarm) at_warm = g_allocations;
    if (done == kCounted) at_end = g_allocations;
    images_done = done;
  };
  run_together();
  EXPECT_EQ(filter_->images_done, kImages);
  ASSERT_GT(at_warm, 0u);
  EXPECT_EQ(at_end - at_warm, 0u);
}

class BodyInboxTest : public testing::Test {
 protected:
  BodyInbox inbox_{2};
  std::vector<Delivery> taken_;
};

TEST_F(BodyInboxTest, KeepsTheOrderOfArrival) {
  ASSERT_TRUE(inbox_.push(imu_at(ms(12)), ms(13)));
  ASSERT_TRUE(inbox_.push(frame_at(ms(10)), ms(14)));
  ASSERT_TRUE(inbox_.take(taken_, {}));
  ASSERT_EQ(taken_.size(), 2u);
  EXPECT_EQ(time_of(taken_[0].sample), ms(12));
  EXPECT_EQ(time_of(taken_[1].sample), ms(10));
  EXPECT_EQ(taken_[1].arrived, ms(14));
}

TEST_F(BodyInboxTest, GivesTheRestAfterTheEnd) {
  ASSERT_TRUE(inbox_.push(frame_at(ms(10)), ms(14)));
  inbox_.finish();
  EXPECT_TRUE(inbox_.take(taken_, {}));
  EXPECT_FALSE(inbox_.take(taken_, {}));
  EXPECT_TRUE(taken_.empty());
}

TEST_F(BodyInboxTest, DropsTheOldestImages) {
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(inbox_.push(imu_at(ms(9 + 50 * i)), ms(9 + 50 * i)));
    ASSERT_TRUE(inbox_.push(frame_at(ms(10 + 50 * i)), ms(10 + 50 * i)));
  }
  EXPECT_EQ(inbox_.images_dropped(), 3u);
  ASSERT_TRUE(inbox_.take(taken_, {}));
  ASSERT_EQ(taken_.size(), 7u);
  EXPECT_EQ(time_of(taken_[4].sample), ms(160)) << "the oldest remaining image";
}

TEST_F(BodyInboxTest, DropsAllWhenImuReadingsPileUp) {
  EXPECT_TRUE(inbox_.push(frame_at(ms(1)), ms(0)));
  const int all = static_cast<int>(BodyInbox::kMaxImu) + 5;
  for (int i = 0; i < all; ++i) ASSERT_TRUE(inbox_.push(imu_at(ms(i)), ms(0)));
  EXPECT_EQ(inbox_.overflows(), 1U);
  ASSERT_TRUE(inbox_.take(taken_, {}));
  ASSERT_EQ(taken_.size(), 5U) << "without a gap";
  EXPECT_EQ(time_of(taken_.front().sample), ms(all - 5));
}

TEST_F(BodyInboxTest, RefusesSamplesAfterItWasClosed) {
  inbox_.close();
  EXPECT_FALSE(inbox_.push(frame_at(ms(10)), ms(14)));
  EXPECT_FALSE(inbox_.take(taken_, {}));
}

TEST_F(BodyInboxTest, DoesNotWaitForSamplesWhenStopped) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(inbox_.take(taken_, stop.get_token()));
}

}  // namespace
}  // namespace fiducap
