#include "scene/scene.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

Instant at_ms(int ms) { return instant_from_ns(1'000'000'000) + std::chrono::milliseconds(ms); }

std::vector<SceneBody> two_bodies() {
  std::vector<SceneBody> bodies(2);
  bodies[0].description = {1, "alpha"};
  bodies[0].sensors.imu = ImuNoise{};
  bodies[1].description = {2, "beta"};
  bodies[1].X_BP.p = {0, 0, 0.1};
  return bodies;
}

BodyEstimate estimate(int ms) {
  BodyEstimate e;
  e.at = at_ms(ms);
  e.covariance = Matrix15d::Identity() * 1e-6;
  e.anchored = true;
  return e;
}

UpdateReport report(int ms) {
  UpdateReport r;
  r.exposed_at = at_ms(ms);
  r.tags_used = 2;
  return r;
}

TEST(Scene, BringsEveryBodyToTheInstantAskedFor) {
  Scene scene(two_bodies());
  scene.ingest(1, estimate(100), report(100), {}, 0);
  const auto map = std::make_shared<TagMap>();
  const auto frame = scene.sample(at_ms(110), at_ms(111), Duration{5}, 200.0, map);
  EXPECT_EQ(frame->number, 1u);
  EXPECT_EQ(frame->at, at_ms(110));
  EXPECT_EQ(frame->published_at, at_ms(111));
  EXPECT_EQ(frame->utc_offset, Duration{5});
  EXPECT_EQ(frame->rate_hz, 200.0);
  EXPECT_EQ(frame->map, map);
  EXPECT_EQ(frame->model, scene.model());
  ASSERT_EQ(frame->bodies.size(), 2u);
  EXPECT_EQ(frame->bodies[0].body_id, 1);
  EXPECT_EQ(frame->bodies[0].state, BodyState::kSearching);
  EXPECT_FALSE(frame->bodies[0].valid);
  EXPECT_EQ(frame->bodies[1].state, BodyState::kTracking);
  EXPECT_TRUE(frame->bodies[1].valid);
  EXPECT_NEAR(frame->bodies[1].X_WP.p.z(), 0.1, 1e-12);
  EXPECT_EQ(scene.sample(at_ms(115), at_ms(116), {}, 200.0, map)->number, 2u);
}

TEST(Scene, DescribesItsBodiesOnceAndForAll) {
  Scene scene(two_bodies());
  ASSERT_EQ(scene.model()->bodies.size(), 2u);
  EXPECT_EQ(scene.model()->bodies[0].name, "alpha");
  EXPECT_EQ(scene.model()->bodies[1].id, 2);
}

TEST(Scene, ADisabledBodyIsFollowedButNotShown) {
  Scene scene(two_bodies());
  scene.set_enabled(0, false);
  scene.ingest(0, estimate(100), report(100), {}, 0);
  auto frame = scene.sample(at_ms(110), at_ms(110), {}, 200.0, nullptr);
  ASSERT_EQ(frame->bodies.size(), 1u);
  EXPECT_EQ(frame->bodies[0].body_id, 2);
  EXPECT_EQ(frame->model->bodies[0].name, "beta");
  EXPECT_EQ(frame->model->generation, 2u);
  scene.set_enabled(0, true);
  frame = scene.sample(at_ms(110), at_ms(110), {}, 200.0, nullptr);
  EXPECT_EQ(frame->model->generation, 3u);
  EXPECT_EQ(frame->bodies[0].state, BodyState::kTracking) << "it was followed all the time";
  scene.set_enabled(0, true);
  EXPECT_EQ(scene.model()->generation, 3u) << "nothing changed";
}

TEST(Scene, RenamingMakesAnotherGenerationAndOldFramesKeepTheirs) {
  Scene scene(two_bodies());
  const auto before = scene.sample(at_ms(110), at_ms(110), {}, 200.0, nullptr);
  scene.rename(1, "gamma");
  EXPECT_EQ(before->model->bodies[1].name, "beta");
  EXPECT_EQ(scene.model()->bodies[1].name, "gamma");
  EXPECT_EQ(scene.model()->bodies[1].id, 2);
  EXPECT_EQ(scene.list()[1].description.name, "gamma");
}

TEST(Scene, ThePivotMoves) {
  Scene scene(two_bodies());
  scene.ingest(1, estimate(100), report(100), {}, 0);
  scene.set_pivot(1, {Eigen::Quaterniond::Identity(), {0.5, 0, 0}});
  EXPECT_NEAR(scene.sample(at_ms(100), at_ms(100), {}, 200.0, nullptr)->bodies[1].X_WP.p.x(), 0.5,
              1e-12);
}

TEST(Scene, ALostSourceLosesOnlyItsBody) {
  Scene scene(two_bodies());
  scene.ingest(0, estimate(100), report(100), {}, 0);
  scene.ingest(1, estimate(100), report(100), {}, 0);
  scene.source_lost(0);
  const auto frame = scene.sample(at_ms(110), at_ms(110), {}, 200.0, nullptr);
  EXPECT_EQ(frame->bodies[0].state, BodyState::kLost);
  EXPECT_EQ(frame->bodies[1].state, BodyState::kTracking);
}

TEST(Scene, APublishedFrameDoesNotChangeAnyMore) {
  Scene scene(two_bodies());
  scene.ingest(1, estimate(100), report(100), {}, 0);
  const auto kept = scene.sample(at_ms(110), at_ms(110), {}, 200.0, nullptr);
  for (int i = 0; i < 5; ++i)
    (void)scene.sample(at_ms(6000 + i), at_ms(6000 + i), {}, 200.0, nullptr);
  EXPECT_EQ(kept->number, 1u);
  EXPECT_EQ(kept->at, at_ms(110));
  EXPECT_TRUE(kept->bodies[1].valid);
}

TEST(Scene, AllocatesNothingAfterWarmUp) {
  Scene scene(two_bodies());
  const auto map = std::make_shared<const TagMap>();
  std::shared_ptr<const SceneFrame> held;
  const auto steady = [&](int from, int to) {
    for (int ms = from; ms < to; ms += 5) {
      scene.add_imu(0, {at_ms(ms), Eigen::Vector3d::Zero(), {0, 0, 9.81}});
      if (ms % 50 == 0) {
        scene.ingest(0, estimate(ms - 30), report(ms - 30), {}, 0);
        scene.ingest(1, estimate(ms - 30), report(ms - 30), {}, 0);
      }
      held = scene.sample(at_ms(ms + 2), at_ms(ms + 2), {}, 200.0, map);
    }
  };
  steady(0, 200);
  const AllocationCounter allocations;
  steady(200, 2000);
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_TRUE(held->bodies[0].valid);
}

// Meant for the thread sanitizer: workers and publisher at the same time.
TEST(Scene, WorkersAndPublisherMayEnterTogether) {
  Scene scene(two_bodies());
  const auto worker = [&scene](std::size_t body) {
    for (int ms = 0; ms < 2000; ms += 5) {
      scene.add_imu(body, {at_ms(ms), Eigen::Vector3d::Zero(), {0, 0, 9.81}});
      if (ms % 50 == 0) scene.ingest(body, estimate(ms), report(ms), {}, 0);
    }
  };
  std::thread first(worker, 0);
  std::thread second(worker, 1);
  std::uint64_t number = 0;
  for (int i = 0; i < 200; ++i)
    number = scene.sample(at_ms(10 * i), at_ms(10 * i), {}, 100.0, nullptr)->number;
  first.join();
  second.join();
  EXPECT_EQ(number, 200u);
  const auto end = scene.sample(at_ms(1990), at_ms(1990), {}, 100.0, nullptr);
  EXPECT_TRUE(end->bodies[0].valid);
  EXPECT_TRUE(end->bodies[1].valid);
}

}  // namespace
}  // namespace fiducap
