#include "pipeline/replay/bodies_replay.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"
#include "support/command_run.hpp"
#include "support/memory_source.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/replay/replay_verbs.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

/// A simulated robot in a hall, its corners with noise.
class Robot {
 public:
  Robot(std::uint64_t seed, double seconds, std::optional<int> reference_tag) {
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
    const auto session = value_of(run_together({a.offline(1), b.offline(2)}, {}));
    EXPECT_GT(session.bodies[0].trajectory.size(), 300u);
    EXPECT_GT(session.bodies[1].trajectory.size(), 200u) << "the other waits for a tag of the map";
    EXPECT_LT(worst_relative_error_m(session, a, b), kFar_m);
    EXPECT_EQ(count(session, MapEvent::Kind::kWorkspace), 1);
  }
}

TEST(MapTurns, AreReadBackInTheirOrder) {
  TemporaryFolder folder;
  auto writer = value_of(TurnWriter<MapTurn>::create(folder.file("turns.csv")));
  const Pose pose{Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1. / 3, -2. / 7, 1e-17}};
  ASSERT_TRUE(writer.write({1, 0, 50'000'000, 0, 3, true, pose}));
  ASSERT_TRUE(writer.write({0, 1, 50'000'000, 0, -1, false, {}}));
  ASSERT_TRUE(writer.flush());
  const auto read = value_of(read_map_turns(folder.file("turns.csv")));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].body, 1u);
  EXPECT_FALSE(read[0].X_WB);
  EXPECT_EQ(read[1].revision, 3);
  ASSERT_TRUE(read[1].X_WB);
  EXPECT_EQ(read[1].X_WB->p, pose.p) << "to the last bit";
}

TEST(MapTurns, RefinementsAreReadBackWithoutTheLastIncompleteLine) {
  TemporaryFolder folder;
  auto writer = value_of(TurnWriter<RefinementTurn>::create(folder.file("refinements.csv")));
  for (const RefinementTurn& turn : {RefinementTurn{10, 12}, {20, {}}, {30, 30}})
    ASSERT_TRUE(writer.write(turn));
  ASSERT_TRUE(writer.close());
  std::ofstream(folder.file("refinements.csv"), std::ios::app) << "50,40\n60,7";
  const auto read = value_of(read_refinement_turns(folder.file("refinements.csv")));
  EXPECT_THAT(read, testing::ElementsAre(testing::FieldsAre(10u, testing::Optional(12u)),
                                         testing::FieldsAre(20u, testing::Eq(std::nullopt)),
                                         testing::FieldsAre(30u, testing::Optional(30u))))
      << "nothing is adopted before it was taken";
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

RecordingInfo info() {
  RecordingInfo info;
  info.name = "table";
  info.cameras.resize(1);
  info.cameras[0].model = {752, 480, 460, 460, 376, 240, Distortion::kNone, {}};
  info.tag_size_m = 0.25;
  info.tag_sizes_m = {{3, 0.5}};
  info.ignore_tags = {9};
  info.max_hamming = 2;
  info.reference_tag = 1;
  info.known_tags = {{1, 0.25, {Eigen::Quaterniond::Identity(), {1, 2, 3}}, 1e-4, 1e-5},
                     {2, 0.25, {Eigen::Quaterniond::Identity(), {4, 5, 6}}, 0.5, 0.1}};
  return info;
}

TEST(OfflineSetup, KnownTagsAreInputsWhenTightAndPriorsWhenLoose) {
  const OfflineSetup setup = offline_setup(info());
  ASSERT_EQ(setup.known.size(), 1u);
  EXPECT_EQ(setup.known[0].tag_id, 1);
  EXPECT_DOUBLE_EQ(setup.known[0].covariance(0, 0), 1e-8);
  EXPECT_DOUBLE_EQ(setup.known[0].covariance(5, 5), 1e-10);
  ASSERT_EQ(setup.priors.size(), 1u);
  EXPECT_DOUBLE_EQ(setup.priors[0].covariance(2, 2), 0.25);
  EXPECT_EQ(setup.gauge.reference_tag, 1);
  EXPECT_EQ(setup.gauge.X_WT->p, Eigen::Vector3d(1, 2, 3));
}

TEST(ReplaySetup, KeepsTheRecordingsValuesOfKeysThatAreNotGiven) {
  const TemporaryFolder folder;
  ReplayArguments arguments;
  arguments.config = folder.file("c.yaml");
  ASSERT_TRUE(write_whole_file(arguments.config,
                               "tags: {size_m: 0.3}\nestimator: {corner_noise_px: 0.7}\n"));
  arguments.sets = {"tags.ignore=[5]"};
  const auto setup = value_of(replay_setup(arguments, info()));
  EXPECT_EQ(setup.tags.size_m, 0.3);
  EXPECT_EQ(setup.tags.sizes_m.at(3), 0.5);
  EXPECT_EQ(setup.tags.ignore, std::vector{5});
  EXPECT_EQ(setup.tags.max_hamming, 2);
  EXPECT_EQ(setup.estimator.corner_noise_px, 0.7);
  EXPECT_EQ(setup.gauge.reference_tag, 1);
}

TEST(ReplaySetup, TagsOfTheMapBecomeInputs) {
  const TemporaryFolder folder;
  ReplayArguments arguments;
  arguments.map = folder.file("m.csv");
  ASSERT_TRUE(
      write_whole_file(arguments.map, "id,size,px,py,pz,qw,qx,qy,qz\n2,0.25,7,8,9,1,0,0,0\n"));
  const auto setup = value_of(replay_setup(arguments, info()));
  ASSERT_EQ(setup.known.size(), 2u);
  EXPECT_EQ(setup.known[1].X_WT.p, Eigen::Vector3d(7, 8, 9));
  EXPECT_TRUE(setup.priors.empty()) << "the map goes before the recording's loose knowledge";
}

class LostSource final : public SensorSource {
 public:
  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    return fail(ErrorCode::kUnavailable, "unplugged", "camera");
  }
};

TEST(OfflineRun, CountsFramesWithoutTags) {
  std::vector<SensorSample> samples;
  for (int i = 1; i <= 5; ++i)
    samples.emplace_back(CornerFrame{0, instant_from_ns(i * 50'000'000), {}});
  MemorySource source(samples);
  const auto result = value_of(run_offline(offline_setup(info()), source));
  EXPECT_EQ(result.statistics.frames, 5);
  EXPECT_EQ(result.statistics.frames_with_tags, 0);
  EXPECT_TRUE(result.trajectory.empty());
  EXPECT_DOUBLE_EQ(result.statistics.data_s, 0.2);
}

TEST(OfflineRun, ALostSourceIsAnError) {
  LostSource source;
  const auto result = run_offline(offline_setup(info()), source);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().text(), "camera: unplugged");
}

// Corner noise 0.4 px at about one metre with f = 460 px: a pose error of a few millimetres. Ten
// times that would be a wrong axis, a swapped corner or a wrong time stamp somewhere on the way.
constexpr double kSound_m = 0.03;
constexpr double kSound_deg = 1.5;

TEST(Verbs, SimulateReplayAndEvaluateWorkTogetherReproducibly) {
  const TemporaryFolder folder;
  const std::string table = folder.file("table");
  const auto succeed = [](const std::vector<std::string>& arguments) {
    const CommandRun done = run_fiducap(arguments);
    EXPECT_EQ(done.code, 0) << done.err;
    return done.out;
  };
  succeed({"simulate", "--out", table, "--room", "table", "--seconds", "15", "--seed", "3"});
  for (const char* run : {"a", "b"}) succeed({"replay", table, "--out", folder.file(run)});
  for (const char* name : {"table.tum", "map.csv", "extrinsics.yaml"})
    EXPECT_EQ(read_whole_file(folder.file("a/") + name).value(),
              read_whole_file(folder.file("b/") + name).value())
        << name;
  const std::string out = succeed({"evaluate", folder.file("a/table.tum"), table, "--json"});
  const auto figures = nlohmann::json::parse(out);
  EXPECT_EQ(figures["against"], "truth");
  EXPECT_GT(figures["pose"]["samples"], 190);
  EXPECT_LT(figures["pose"]["position_rmse_m"], kSound_m) << out;
  EXPECT_LT(figures["pose"]["orientation_rmse_deg"], kSound_deg) << out;
  EXPECT_EQ(figures["map"]["samples"], 2);
  EXPECT_LT(figures["map"]["position_rmse_m"], kSound_m) << out;
  EXPECT_GT(figures["coverage"]["share"], 0.95) << out;

  ASSERT_TRUE(write_whole_file(folder.file("a/table.tum"), "# no pose\n"));
  const CommandRun failed = run_fiducap({"evaluate", folder.file("a/table.tum"), table});
  EXPECT_EQ(failed.code, 1);
  EXPECT_THAT(failed.err, HasSubstr("no pose in it belongs to an image"));
}

}  // namespace
}  // namespace fiducap
