#include "pipeline/replay/bodies_replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>

#include "pipeline/replay/offline_run.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

/// A simulated robot in a hall, its corners with noise.
class Robot {
 public:
  Robot(std::uint64_t seed, double seconds, std::optional<int> reference_tag,
        const simulation::FaultConfig& faults = {}) {
    simulation::RoomConfig room;
    room.preset = "table";
    simulation::SimulatedBodyConfig body;
    CameraMount mount;
    mount.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    mount.X_BV = simulation::forward_camera();
    body.cameras = {mount};
    body.camera.images = false;
    body.trajectory.kind = "table";
    body.trajectory.duration_s = seconds;
    body.trajectory.seed = body.seed = seed;
    body.faults = faults;
    source_ = *simulation::make_simulated_source(room, body, instant_from_ns(0), nullptr);
    setup_.sensors = {{mount}, body.imu.noise};
    for (const RecordedTag& tag : simulation::tags_of(room))
      setup_.tags.sizes_m[tag.tag_id] = tag.edge_m;
    setup_.gauge.reference_tag = reference_tag;
  }

  [[nodiscard]] OfflineBody offline(int id) const {
    return {id, "robot" + std::to_string(id), setup_, source_.get()};
  }
  [[nodiscard]] const simulation::SimulatedSource& source() const { return *source_; }
  OfflineSetup& setup() { return setup_; }

 private:
  OfflineSetup setup_;
  std::unique_ptr<simulation::SimulatedSource> source_;
};

/// Largest error of a pose's distance from an earlier pose, over the end of a run: no fit of W.
double worst_step_error_m(const OfflineResult& result, const simulation::SimulatedSource& source) {
  double worst = 0;
  const auto& poses = result.trajectory;
  for (std::size_t i = poses.size() / 2; i < poses.size(); ++i) {
    const auto& a = poses[poses.size() / 2];
    const double estimated = (poses[i].X_WB.p - a.X_WB.p).norm();
    const double true_m = (source.truth(poses[i].at).X_WB.p - source.truth(a.at).X_WB.p).norm();
    worst = std::max(worst, std::abs(estimated - true_m));
  }
  return worst;
}

/// The bodies' poses against each other: one room, so the true pose of one in the other's axes.
double worst_relative_error_m(const OfflineSession& session, const Robot& a, const Robot& b) {
  double worst = 0;
  const auto& mine = session.bodies[0].trajectory;
  const auto& theirs = session.bodies[1].trajectory;
  for (const StampedPose& pose : mine) {
    const auto other = std::lower_bound(theirs.begin(), theirs.end(), pose.at,
                                        [](const StampedPose& p, Instant at) { return p.at < at; });
    if (other == theirs.end() || other->at != pose.at || to_seconds(pose.at - Instant{}) < 8)
      continue;
    const Pose estimated = pose.X_WB.inverse() * other->X_WB;
    const Pose true_pose =
        a.source().truth(pose.at).X_WB.inverse() * b.source().truth(pose.at).X_WB;
    worst = std::max(worst, (estimated.p - true_pose.p).norm());
  }
  return worst;
}

auto count(const OfflineSession& session, MapEvent::Kind kind) {
  return std::ranges::count(session.map_events, kind,
                            [](const auto& entry) { return entry.event.kind; });
}

TEST(BodiesReplay, TwoBodiesWithoutReferenceTagShareOneWorkspace) {
  constexpr double kFar_m = 0.05;  // two workspaces would be metres apart
  for (const std::uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    Robot a(seed, 25, std::nullopt);
    Robot b(seed + 100, 25, std::nullopt);
    const auto session = run_together({a.offline(1), b.offline(2)}, {});
    ASSERT_TRUE(session) << session.error().text();
    EXPECT_GT(session->bodies[0].trajectory.size(), 300u);
    EXPECT_GT(session->bodies[1].trajectory.size(), 200u) << "the other waits for a tag of the map";
    EXPECT_LT(worst_relative_error_m(*session, a, b), kFar_m);
    EXPECT_EQ(count(*session, MapEvent::Kind::kWorkspace), 1);
  }
}

TEST(BodiesReplay, IsReproducible) {
  const auto run = [] {
    Robot a(1, 12, 0);
    Robot b(2, 12, 0);
    return run_together({a.offline(1), b.offline(2)}, {});
  };
  const auto once = run();
  const auto again = run();
  ASSERT_TRUE(once && again);
  for (std::size_t body = 0; body < 2; ++body) {
    ASSERT_EQ(once->bodies[body].trajectory.size(), again->bodies[body].trajectory.size());
    for (std::size_t i = 0; i < once->bodies[body].trajectory.size(); ++i)
      ASSERT_EQ(once->bodies[body].trajectory[i].X_WB.p, again->bodies[body].trajectory[i].X_WB.p);
  }
}

TEST(BodiesReplay, AMovedTagDoesNotDistortTheMapAndIsEstimatedAgain) {
  constexpr double kTorn_m = 0.1;  // re-tied to the stale place, poses are 0.4 m off
  for (const bool with_reference : {false, true}) {
    SCOPED_TRACE(with_reference);
    simulation::FaultConfig faults;
    faults.moved_tag = 0;
    faults.moved_at_s = 20;
    faults.moved_by_m = {0.3, 0.4, 0};
    Robot robot(5, 60, with_reference ? std::optional(0) : std::nullopt, faults);
    const auto session = run_together({robot.offline(1)}, {});
    ASSERT_TRUE(session) << session.error().text();
    EXPECT_LT(worst_step_error_m(session->bodies[0], robot.source()), kTorn_m);
    EXPECT_GT(count(*session, MapEvent::Kind::kTagQuarantined), 0);
    EXPECT_GT(count(*session, MapEvent::Kind::kTagMoved), 0);
  }
}

TEST(MapTurns, AreReadBackInTheirOrder) {
  TemporaryFolder folder;
  auto writer = TurnWriter<MapTurn>::create(folder.file("turns.csv"));
  ASSERT_TRUE(writer);
  const Pose pose{Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1. / 3, -2. / 7, 1e-17}};
  ASSERT_TRUE(writer->write({1, 0, 50'000'000, 0, 3, true, pose}));
  ASSERT_TRUE(writer->write({0, 1, 50'000'000, 0, -1, false, {}}));
  ASSERT_TRUE(writer->flush());
  const auto read = read_map_turns(folder.file("turns.csv"));
  ASSERT_TRUE(read);
  ASSERT_EQ(read->size(), 2u);
  EXPECT_EQ((*read)[0].body, 1u);
  EXPECT_FALSE((*read)[0].X_WB);
  EXPECT_EQ((*read)[1].revision, 3);
  ASSERT_TRUE((*read)[1].X_WB);
  EXPECT_EQ((*read)[1].X_WB->p, pose.p) << "to the last bit";
}

TEST(MapTurns, RefinementsAreReadBackWithoutTheLastIncompleteLine) {
  TemporaryFolder folder;
  auto writer = TurnWriter<RefinementTurn>::create(folder.file("refinements.csv"));
  ASSERT_TRUE(writer);
  for (const RefinementTurn& turn : {RefinementTurn{10, 12}, {20, {}}, {30, 30}})
    ASSERT_TRUE(writer->write(turn));
  ASSERT_TRUE(writer->close());
  std::ofstream(folder.file("refinements.csv"), std::ios::app) << "50,40\n60,7";
  const auto read = read_refinement_turns(folder.file("refinements.csv"));
  ASSERT_TRUE(read);
  ASSERT_EQ(read->size(), 3u) << "nothing is adopted before it was taken";
  EXPECT_EQ((*read)[0].adopted, 12u);
  EXPECT_EQ((*read)[1].taken, 20u);
  EXPECT_FALSE((*read)[1].adopted);
  EXPECT_EQ((*read)[2].adopted, 30u);
}

TEST(BodiesReplay, RefinesWhereTheSessionDidAndCountsDifferences) {
  constexpr std::uint64_t kTaken = 200;
  constexpr std::uint64_t kAdopted = 230;
  MapConfig map;
  map.refine_period_s = 1;
  std::vector<MapTurn> turns;
  const auto run =
      [&](std::optional<std::vector<RefinementTurn>> refinements,
          const std::function<void(const BodyUpdate&, std::uint64_t revision)>& watch) {
        Robot robot(1, 13, 0);
        BodiesReplay replay({{1, "a", robot.setup(), robot.offline(1).source}}, map, {});
        replay.follow(turns, std::move(refinements));
        EXPECT_TRUE(replay.run(
            [&](std::size_t, const BodyUpdate& update) { watch(update, replay.view().revision); }));
        return replay.turns_missed();
      };
  run(std::nullopt, [&](const BodyUpdate& update, std::uint64_t) {
    MapTurn turn;
    turn.turn = turns.size();
    turn.stamp_ns = to_ns(update.corners.exposed_at - update.corners.clock_shift);
    turn.may_define_workspace = true;
    turn.revision = turn.turn < kAdopted ? 0 : 1;
    turns.push_back(turn);
  });
  ASSERT_GT(turns.size(), kAdopted + 20);

  std::vector<std::uint64_t> revisions;
  const auto note = [&](const BodyUpdate&, std::uint64_t revision) {
    revisions.push_back(revision);
  };
  EXPECT_EQ(run({{{kTaken, kAdopted}}}, note), 0u);
  const auto first = std::find(revisions.begin(), revisions.end(), 1u) - revisions.begin();
  EXPECT_EQ(static_cast<std::uint64_t>(first), kAdopted) << "not by its period";
  EXPECT_EQ(revisions.back(), 1u);

  revisions.clear();
  EXPECT_GT(run({{{kTaken, {}}}}, note), 0u) << "the session did not adopt it";
  EXPECT_EQ(revisions.back(), 0u);
}

TEST(BodiesReplay, FollowsTheTurnsOfASessionAndComparesEstimates) {
  const auto replay_of = [](Robot& a, Robot& b) {
    return BodiesReplay(
        {{1, "a", a.setup(), a.offline(1).source}, {2, "b", b.setup(), b.offline(2).source}}, {},
        {});
  };
  const auto robot = [](std::uint64_t seed) { return Robot(seed, 8, std::nullopt); };
  // A run in order of time, recorded like a session.
  Robot a = robot(1);
  Robot b = robot(2);
  BodiesReplay live = replay_of(a, b);
  std::vector<MapTurn> turns;
  ASSERT_TRUE(live.run([&](std::size_t body, const BodyUpdate& update) {
    MapTurn turn;
    turn.turn = turns.size();
    turn.body = body;
    turn.stamp_ns = to_ns(update.corners.exposed_at - update.corners.clock_shift);
    turn.revision = static_cast<std::int64_t>(live.view().revision);
    turn.may_define_workspace = live.view().may_define_workspace;
    if (update.is_placed()) turn.X_WB = update.estimate->X_WB;
    turns.push_back(turn);
  }));
  Robot a_again = robot(1);
  Robot b_again = robot(2);
  BodiesReplay again = replay_of(a_again, b_again);
  again.follow(turns);
  ASSERT_TRUE(again.run({}));
  EXPECT_EQ(again.turns_missed(), 0u);
  EXPECT_GT(again.agreement().compared, 100u);
  EXPECT_EQ(again.agreement().different, 0u);
}

}  // namespace
}  // namespace fiducap
