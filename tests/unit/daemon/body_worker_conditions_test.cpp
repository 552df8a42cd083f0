// Conditions of a body, and its restart after a failure.
#include "body_worker_fixture.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;

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
  std::thread reader([&] { worker_->read(0, {}); });
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
  std::thread reader([this] { worker_->read(0, {}); });
  worker_->work({});
  reader.join();
  EXPECT_EQ(worker_->statistics().restarts, 1U);
  const auto told = events_.after(0);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_THAT(told[0].sentence(), testing::HasSubstr("robot: estimator failed (a matrix is"));
  EXPECT_EQ(told[1].sentence(), "robot: is tracked again");
}

TEST_F(BodyWorkerTest, CountsOnAfterANewBeginning) {
  build_three_images();
  filter_->throws_at = 1;
  worker_->read(0, {});
  clock_.advance(std::chrono::milliseconds(500));  // two of three are too old by now
  worker_->work({});
  EXPECT_EQ(worker_->statistics().restarts, 1U);
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
  EXPECT_EQ(worker_->statistics().restarts, 1U);
  std::vector<std::string> told;
  for (const Event& event : events_.after(0))
    if (event.kind == "imu_silent") told.push_back(event.over ? event.text : "silent");
  EXPECT_THAT(told, ElementsAre("silent", testing::HasSubstr("estimator restarts")));
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
  std::thread reader([this] { worker_->read(0, {}); });
  worker_->work({});
  reader.join();
  EXPECT_LE(worker_->statistics().restarts, 13U) << "100 ms, 200 ms, … 30 s, 30 s";
  EXPECT_GE(worker_->statistics().restarts, 9U);
  ASSERT_EQ(events_.after(0).size(), 2U) << "said once, and that it is over";
  EXPECT_EQ(events_.after(0)[1].text, "its source has ended");
}

}  // namespace
}  // namespace fiducap
