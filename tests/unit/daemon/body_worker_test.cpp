#include "daemon/bodies/body_worker.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fake_body.hpp"
#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

ImuSample imu_at(Instant at) { return {at, Eigen::Vector3d::Zero(), {0, 0, 9.81}}; }

/// A tag of 100 px in the middle of the image.
TagSighting sighting(int id) {
  return {id, 0, 60.0, {{{326, 290}, {426, 290}, {426, 190}, {326, 190}}}};
}

CornerFrame frame_at(Instant at, std::vector<int> ids = {4}) {
  CornerFrame frame{0, at, {}};
  for (const int id : ids) frame.tags.push_back(sighting(id));
  return frame;
}

KnownTag known_tag(int id) {
  KnownTag tag{id, 0.16, {}};
  tag.covariance = Matrix6d::Identity() * 1e-6;
  return tag;
}

/// One body called `robot` with a camera and an IMU, everything real except its source and its
/// filter.
class BodyWorkerTest : public testing::Test {
 protected:
  BodyWorkerTest() {
    CameraMount mount;
    mount.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    sensors_.cameras = {mount};
    sensors_.imu = ImuNoise{};
  }

  void build(std::unique_ptr<SensorSource> source) {
    std::vector<SceneBody> bodies(1);
    bodies[0].description = {1, "robot"};
    bodies[0].sensors = sensors_;
    scene_ = std::make_unique<Scene>(bodies);
    map_ = std::make_unique<MapBuilder>(MapConfig{}, start_);
    PipelineSetup setup;
    setup.sensors = sensors_;
    setup.estimator = estimator_;
    worker_ = std::make_unique<BodyWorker>(
        BodyParts{0, 1, "robot", std::move(setup), std::move(source), [this] { return filter(); }},
        SharedParts{*map_, *scene_, clock_, recorder_, events_});
  }
  std::unique_ptr<BodyFilter> filter() {
    auto filter = std::make_unique<RecordingFilter>(log_);
    filter_ = filter.get();
    if (fails_always_) filter_->throws_at = log_.updated.size() + 1;
    return filter;
  }
  void build(std::vector<SensorSample> samples) {
    build(std::make_unique<ScriptedSource>(std::move(samples)));
  }

  /// Reader and worker one after the other: what the threads do, without threads.
  void run() {
    worker_->read({});
    worker_->work({});
  }
  BodyPose pose_at(Instant at) {
    return scene_->sample(at, at, {}, 100, map_->snapshot())->bodies.front();
  }

  EventBoard events_{[] { return std::int64_t{0}; }};
  BodySensors sensors_;
  TagMap start_;
  FakeClock clock_{ms(1000)};
  EstimatorConfig estimator_;
  SessionRecorder recorder_{RecorderConfig{}, clock_, events_};
  RecordingFilter::Log log_;
  RecordingFilter* filter_{nullptr};
  bool fails_always_{false};  ///< Every filter that is made from now on.
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<MapBuilder> map_;
  std::unique_ptr<BodyWorker> worker_;
};

TEST_F(BodyWorkerTest, GivesTheFilterImuReadingsAndImagesInItsOrder) {
  build(
      {imu_at(ms(1000)), imu_at(ms(1005)), imu_at(ms(1010)), frame_at(ms(1004)), imu_at(ms(1015))});
  run();
  EXPECT_THAT(log_.propagated, ElementsAre(ms(1000), ms(1005), ms(1010), ms(1015)));
  ASSERT_EQ(log_.updated.size(), 1u);
  EXPECT_EQ(log_.updated[0].exposed_at, ms(1004));
  ASSERT_EQ(log_.updated[0].tags.size(), 1u);
  EXPECT_EQ(log_.updated[0].tags[0].tag_id, 4);
}

TEST_F(BodyWorkerTest, AnImuInAnotherUnitIsAConditionOfTheBody) {
  std::vector<SensorSample> samples;
  for (int t = 1000; t < 6000; t += 10) {
    samples.emplace_back(ImuSample{ms(t), Eigen::Vector3d::Zero(), {0, 0, 1}});
    if (t % 100 == 0) samples.emplace_back(frame_at(ms(t)));
  }
  build(std::move(samples));
  run();
  const auto told = events_.after(0);
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(told[0].kind, "imu_readings");
  EXPECT_EQ(told[0].severity, Severity::kError);
  EXPECT_THAT(told[0].text, testing::HasSubstr("9.80665"));
  EXPECT_EQ(told[1].text, "its source has ended");
}

TEST_F(BodyWorkerTest, AnImuThatWasMendedIsNoConditionAnyMore) {
  std::vector<SensorSample> samples;
  for (int t = 1000; t < 30'000; t += 10) {
    samples.emplace_back(ImuSample{ms(t), Eigen::Vector3d::Zero(), {0, 0, t < 9000 ? 1 : 9.81}});
    if (t % 100 == 0) samples.emplace_back(frame_at(ms(t)));
  }
  std::atomic<int> images_done{0};
  build(std::make_unique<PacedSource>(std::move(samples), images_done));
  std::vector<std::size_t> standing;
  filter_->on_image = [&](int done) {
    images_done = done;
    if (done == 70 || done == 280) standing.push_back(events_.standing().size());
  };
  std::thread reader([&] { worker_->read({}); });
  worker_->work({});
  reader.join();
  EXPECT_THAT(standing, ElementsAre(1U, 0U));
}

TEST_F(BodyWorkerTest, ASilentImuIsAConditionUntilItIsBack) {
  std::vector<SensorSample> samples;
  for (int t = 1000; t < 9000; t += 10) {
    if (t < 2000 || t > 7000) samples.emplace_back(imu_at(ms(t)));
    if (t == 1500 || t == 2900 || t == 3300 || t == 8000) samples.emplace_back(frame_at(ms(t)));
  }
  build(std::move(samples));
  run();
  std::vector<std::string> told;
  for (const Event& event : events_.after(0))
    if (event.kind == "imu_silent") told.push_back(event.over ? "back" : "silent");
  EXPECT_THAT(told, ElementsAre("silent", "back"));
  EXPECT_THAT(events_.standing(), testing::IsEmpty());
}

TEST_F(BodyWorkerTest, TellsTheFilterWhereSeenTagsAreThatTheMapKnows) {
  start_.tags = {{known_tag(4), TagState::kCalibrated, 0, 0, 0, 0},
                 {known_tag(9), TagState::kCalibrated, 0, 0, 0, 0}};
  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002), {4, 5})});
  run();
  ASSERT_EQ(log_.known.size(), 1u);
  ASSERT_EQ(log_.known[0].size(), 1u);
  EXPECT_EQ(log_.known[0][0].tag_id, 4);
}

TEST_F(BodyWorkerTest, BringsTheFiltersBeliefsIntoTheMap) {
  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))});
  filter_->beliefs = {{known_tag(4), 100, ms(0), ms(1002)}};
  run();
  EXPECT_NE(map_->snapshot()->find(4), nullptr);
}

TEST_F(BodyWorkerTest, HandsTheTagUnseenForLongestOverToTheMapWhenTheFilterHoldsMany) {
  estimator_.hand_over_above = 2;
  start_.tags = {{known_tag(4), TagState::kLocal, 0, 0, 0, 0},
                 {known_tag(6), TagState::kLocal, 0, 0, 0, 0}};
  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))});
  // 5 is older, but the map does not have it; 4 is in view.
  filter_->beliefs = {{known_tag(4), 1, ms(0), ms(1002)},
                      {known_tag(5), 1, ms(0), ms(-5000)},
                      {known_tag(6), 1, ms(0), ms(-3000)}};
  run();
  EXPECT_THAT(filter_->released, ElementsAre(6));
}

TEST_F(BodyWorkerTest, KeepsTheFiltersTagsWhileTheyAreFew) {
  start_.tags = {{known_tag(6), TagState::kLocal, 0, 0, 0, 0}};
  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))});
  filter_->beliefs = {{known_tag(6), 1, ms(0), ms(-3000)}};
  run();
  EXPECT_TRUE(filter_->released.empty());
}

TEST_F(BodyWorkerTest, ShowsTheBodyWhileItIsFedAndLosesItWhenTheSourceHasEnded) {
  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))});
  worker_->read({});
  EXPECT_FALSE(worker_->pulse().ended);
  worker_->work({});
  EXPECT_TRUE(worker_->pulse().ended);
  EXPECT_EQ(pose_at(ms(1006)).state, BodyState::kLost);
  EXPECT_FALSE(pose_at(ms(1006)).valid);
}

TEST_F(BodyWorkerTest, LosesTheBodyWhenTheDeviceFailsAfterAllItGaveWasUsed) {
  build(std::make_unique<ScriptedSource>(
      std::vector<SensorSample>{imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))},
      Error{ErrorCode::kUnavailable, "unplugged", "/dev/video0"}));
  run();
  EXPECT_EQ(log_.updated.size(), 1u);
  EXPECT_EQ(pose_at(ms(1006)).state, BodyState::kLost);
}

TEST_F(BodyWorkerTest, ReadsOnAfterADriverThatThrewAndSaysSo) {
  auto source = std::make_unique<ScriptedSource>(
      std::vector<SensorSample>{imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))});
  source->throws = 3;
  build(std::move(source));
  EXPECT_NO_THROW(run());
  EXPECT_EQ(log_.updated.size(), 1u);
  const auto told = events_.after(0);
  const auto failed = std::find_if(told.begin(), told.end(),
                                   [](const Event& e) { return e.kind == "source_failed"; });
  ASSERT_NE(failed, told.end());
  EXPECT_THAT(failed->text, testing::HasSubstr("the driver threw"));
  for (const auto& event : events_.standing()) EXPECT_NE(event.kind, "source_failed");
}

TEST_F(BodyWorkerTest, BeginsAnewWhenItsFilterThrowsAndSaysWhenItIsBack) {
  int images = 0;
  build(std::make_unique<EndlessSource>([&](int k) -> std::optional<SensorSample> {
    const auto told = events_.after(0);
    if (!told.empty() && told.back().over) return std::nullopt;
    if (k % 2 == 0) return imu_at(ms(1000 + 5 * k));
    return frame_at(ms(1000 + 5 * k - 2), {4 + images++ % 2});
  }));
  filter_->throws_at = 3;
  std::thread reader([this] { worker_->read({}); });
  worker_->work({});
  reader.join();
  EXPECT_EQ(worker_->statistics().new_beginnings, 1U);
  const auto told = events_.after(0);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_THAT(told[0].sentence(), testing::HasSubstr("robot: its estimate broke off (a matrix is"));
  EXPECT_EQ(told[1].sentence(), "robot: is tracked again");
}

TEST_F(BodyWorkerTest, CountsOnAfterANewBeginning) {
  std::vector<SensorSample> samples;
  for (int k = 0; k < 3; ++k) {
    samples.push_back(imu_at(ms(1000 + 100 * k)));
    samples.push_back(frame_at(ms(1042 + 100 * k)));
  }
  samples.push_back(imu_at(ms(1300)));
  build(std::make_unique<EndlessSource>([&](int k) -> std::optional<SensorSample> {
    clock_.advance(std::chrono::milliseconds(50));
    if (static_cast<std::size_t>(k) == samples.size()) return std::nullopt;
    return samples[static_cast<std::size_t>(k)];
  }));
  filter_->throws_at = 1;
  worker_->read({});
  clock_.advance(std::chrono::milliseconds(500));  // two of three are too old by now
  worker_->work({});
  EXPECT_EQ(worker_->statistics().new_beginnings, 1U);
  EXPECT_EQ(worker_->statistics().images_dropped, 2U);
  EXPECT_EQ(worker_->statistics().pipeline.skipped, 2U);
  EXPECT_EQ(worker_->statistics().pipeline.imu_samples, log_.propagated.size());
}

TEST_F(BodyWorkerTest, NothingStandsThatTheEndOfItsSourceHasSettled) {
  auto source = std::make_unique<ScriptedSource>(std::vector<SensorSample>{});
  source->throws = 1;
  build(std::move(source));
  run();
  ASSERT_FALSE(events_.after(0).empty());
  EXPECT_EQ(events_.after(0).front().kind, "source_failed");
  EXPECT_THAT(events_.standing(), testing::IsEmpty());

  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))});
  filter_->throws_at = log_.updated.size() + 1;
  run();
  EXPECT_THAT(events_.standing(), testing::IsEmpty());
  EXPECT_EQ(events_.after(0).back().kind, "failed");
  EXPECT_EQ(events_.after(0).back().text, "its source has ended");
}

TEST_F(BodyWorkerTest, ANewBeginningLooksAtTheImuAnew) {
  std::vector<SensorSample> samples;
  for (int t = 1000; t < 7000; t += 10) {
    if (t < 2000 || t > 6000) samples.emplace_back(imu_at(ms(t)));
    if (t == 1500 || t == 2900 || t == 3300 || t == 6500) samples.emplace_back(frame_at(ms(t)));
  }
  build(std::move(samples));
  filter_->throws_at = 3;
  run();
  EXPECT_EQ(worker_->statistics().new_beginnings, 1U);
  std::vector<std::string> told;
  for (const Event& event : events_.after(0))
    if (event.kind == "imu_silent") told.push_back(event.over ? event.text : "silent");
  EXPECT_THAT(told, ElementsAre("silent", testing::HasSubstr("begins anew")));
}

TEST_F(BodyWorkerTest, OneThatFailsAgainAndAgainWaitsLongerAndLonger) {
  const Instant begin = clock_.now();
  build(std::make_unique<EndlessSource>([&](int k) -> std::optional<SensorSample> {
    if (clock_.now() - begin > std::chrono::seconds(120)) return std::nullopt;
    if (k % 2 == 0) return imu_at(ms(1000 + 5 * k));
    return frame_at(ms(1000 + 5 * k - 2));
  }));
  fails_always_ = true;
  filter_->throws_at = 1;
  std::thread reader([this] { worker_->read({}); });
  worker_->work({});
  reader.join();
  EXPECT_LE(worker_->statistics().new_beginnings, 13U) << "100 ms, 200 ms, … 30 s, 30 s";
  EXPECT_GE(worker_->statistics().new_beginnings, 9U);
  ASSERT_EQ(events_.after(0).size(), 2U) << "said once, and that it is over";
  EXPECT_EQ(events_.after(0)[1].text, "its source has ended");
}

TEST_F(BodyWorkerTest, TellsTheFilterThatMotionWasLostWhenTagsComeBackAfterTheBodyWasLost) {
  const int lost = 1000 + 6000;  // BodyLimits::lose_after_s is 5
  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002)), imu_at(ms(lost)),
         imu_at(ms(lost + 5)), frame_at(ms(lost + 2))});
  run();
  EXPECT_EQ(log_.losses, 1);
  EXPECT_EQ(log_.updated.size(), 2u);
}

TEST_F(BodyWorkerTest, KeepsBrokenImuReadingsAwayFromEverybody) {
  ImuSample broken = imu_at(ms(1003));
  broken.f_B.x() = std::nan("");
  build({imu_at(ms(1000)), broken, imu_at(ms(1005)), frame_at(ms(1002))});
  run();
  EXPECT_THAT(log_.propagated, ElementsAre(ms(1000), ms(1005)));
  EXPECT_EQ(worker_->statistics().pipeline.merger.bad_dropped, 1u);
}

TEST_F(BodyWorkerTest, IgnoresTheImuOfABodyThatShallHaveNone) {
  sensors_.imu.reset();
  build({imu_at(ms(1000)), frame_at(ms(1002)), imu_at(ms(1005))});
  run();
  EXPECT_TRUE(log_.propagated.empty());
  EXPECT_EQ(log_.updated.size(), 1u);
}

TEST_F(BodyWorkerTest, LeavesImagesOfACameraOutThatTheBodyDoesNotHave) {
  CornerFrame second = frame_at(ms(1002));
  second.camera = 1;
  build({imu_at(ms(1000)), second, imu_at(ms(1005))});
  run();
  EXPECT_TRUE(log_.updated.empty());
}

TEST_F(BodyWorkerTest, CountsWhatItDid) {
  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002), {4, 5}), imu_at(ms(1010)),
         frame_at(ms(1008), {})});
  run();
  const BodyStatistics done = worker_->statistics();
  EXPECT_EQ(done.pipeline.frames, 2u);
  EXPECT_EQ(done.pipeline.frames_with_pose, 1u);
  EXPECT_EQ(done.pipeline.tags_used, 2u);
  EXPECT_EQ(done.pipeline.imu_samples, 3u);
  EXPECT_GT(done.pipeline.update_cpu.count(), 0);
  EXPECT_THAT(done.text(),
              testing::HasSubstr("2 frames (1 with pose), 2 tags used, 3 IMU samples"));
  EXPECT_EQ(worker_->learned().size(), 1u);
}

TEST_F(BodyWorkerTest, WhenItDoesNotKeepUpTheOldestImagesGoAndNoImuReading) {
  constexpr int kImages = 20;
  std::vector<SensorSample> samples;
  for (int k = 0; k < kImages; ++k) {
    for (int i = 0; i < 10; ++i) samples.push_back(imu_at(ms(1000 + 50 * k + 5 * i)));
    samples.push_back(frame_at(ms(1000 + 50 * k + 42)));
  }
  build(std::move(samples));
  run();  // everything has been read before the worker looks for the first time
  EXPECT_EQ(log_.propagated.size(), 10u * kImages);
  ASSERT_FALSE(log_.updated.empty());
  EXPECT_EQ(log_.updated.back().exposed_at, ms(1000 + 50 * (kImages - 1) + 42))
      << "the newest is not the one to go";
  EXPECT_EQ(log_.updated.size() + worker_->statistics().images_dropped,
            static_cast<std::size_t>(kImages));
  EXPECT_LE(log_.updated.size(), 4u);
}

TEST_F(BodyWorkerTest, AnImageThatWaitedTooLongIsLeftOutWhenANewerOneHasCome) {
  std::vector<SensorSample> samples;
  for (int k = 0; k < 3; ++k) {
    samples.push_back(imu_at(ms(1000 + 100 * k)));
    samples.push_back(frame_at(ms(1042 + 100 * k)));
  }
  samples.push_back(imu_at(ms(1300)));
  build(std::make_unique<EndlessSource>([&](int k) -> std::optional<SensorSample> {
    clock_.advance(std::chrono::milliseconds(50));
    if (static_cast<std::size_t>(k) == samples.size()) return std::nullopt;
    return samples[static_cast<std::size_t>(k)];
  }));
  worker_->read({});
  clock_.advance(std::chrono::milliseconds(500));  // the worker gets no time meanwhile
  worker_->work({});
  ASSERT_EQ(log_.updated.size(), 1U);
  EXPECT_EQ(log_.updated.front().exposed_at, ms(1242)) << "the newest";
  EXPECT_EQ(log_.propagated.size(), 4U) << "every IMU reading is used";
  EXPECT_EQ(worker_->statistics().images_dropped, 2U);
}

TEST_F(BodyWorkerTest, EndsWithoutLosingTheBodyWhenTheServerStops) {
  build({imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))});
  std::stop_source stop;
  stop.request_stop();
  worker_->read(stop.get_token());
  worker_->work(stop.get_token());
  EXPECT_TRUE(log_.updated.empty());
  EXPECT_EQ(pose_at(ms(1006)).state, BodyState::kSearching);
}

TEST_F(BodyWorkerTest, AllocatesNothingPerSampleAfterWarmUp) {
  constexpr int kImages = 300;
  constexpr int kWarm = 150;
  constexpr int kCounted =
      kImages - 2 * PacedSource::kAhead;  // the end of the source is a line in the log
  std::vector<SensorSample> samples;
  for (int k = 0; k < kImages; ++k) {
    for (int i = 0; i < 10; ++i) samples.push_back(imu_at(ms(1000 + 50 * k + 5 * i)));
    samples.push_back(frame_at(ms(1000 + 50 * k + 42), {4, 5, 6}));
  }
  start_.tags = {{known_tag(4), TagState::kCalibrated, 0, 0, 0, 0}};
  std::atomic<int> images_done{0};
  build(std::make_unique<PacedSource>(std::move(samples), images_done));
  filter_->quiet = true;
  filter_->beliefs = {{known_tag(5), 100, ms(0), ms(1002)}};
  std::uint64_t at_warm = 0;
  std::uint64_t at_end = 0;
  filter_->on_image = [&](int done) {
    if (done == kWarm) at_warm = g_allocations;
    if (done == kCounted) at_end = g_allocations;
    images_done = done;
  };
  std::thread reader([&] { worker_->read({}); });
  worker_->work({});
  reader.join();
  EXPECT_EQ(filter_->images_done, kImages);
  ASSERT_GT(at_warm, 0u);
  EXPECT_EQ(at_end - at_warm, 0u);
}

}  // namespace
}  // namespace fiducap
