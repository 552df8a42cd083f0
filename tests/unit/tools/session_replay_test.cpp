// What the server's recorder writes, replayed by `fiducap replay`.
#include <gmock/gmock.h>

#include <thread>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "daemon/bodies/body_setup.hpp"
#include "daemon/recording/session_recorder.hpp"
#include "pipeline/replay/bodies_replay.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"
#include "support/command_run.hpp"
#include "support/fake_clock.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/replay/replay_verbs.hpp"

namespace fiducap {
namespace {

/// Two simulated robots in one room, as a server has them; the recorder starts later.
class SessionReplayTest : public testing::Test {
 protected:
  SessionReplayTest() {
    config_.simulation.preset = "table";
    for (const RecordedTag& tag : simulation::tags_of(config_.simulation))
      config_.tags.sizes_m[tag.tag_id] = tag.edge_m;
    for (int k = 0; k < 2; ++k) {
      BodyConfig body;
      body.name = k == 0 ? "arm" : "drone";
      body.id = k + 1;
      body.source.type = SourceType::kSimulator;
      auto& robot = body.source.simulator;
      robot.camera.images = false;
      robot.trajectory.kind = "table";
      robot.trajectory.duration_s = 20;
      robot.trajectory.seed = robot.seed = static_cast<std::uint64_t>(k) + 1;
      CameraConfig camera;
      camera.mount.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
      camera.mount.X_BV = simulation::forward_camera();
      body.cameras = {camera};
      config_.bodies.push_back(body);
    }
  }

  /// Runs the bodies in virtual time; the recorder gets what the workers would give it.
  void run_and_record(double from_s) {
    SessionRecorder recorder({.folder = folder_.file("recordings")}, clock_, events_);
    std::vector<ReplayedBody> bodies;
    std::vector<std::unique_ptr<SensorSource>> sources;
    const Instant start = instant_from_ns(1'000'000'000'000);
    for (const BodyConfig& body : config_.bodies) {
      const auto setup = read_body_setup(body, config_.simulation, config_.site);
      ASSERT_TRUE(setup);
      auto robot = body.source.simulator;
      robot.cameras = setup->sensors.cameras;
      sources.push_back(
          value_of(simulation::make_simulated_source(config_.simulation, robot, start, nullptr)));
      recorder.add_body(body.name, recording_of(setup->sensors, config_.tags, std::nullopt));
      bodies.push_back(
          {body.id, body.name, pipeline_setup(config_, body, *setup), sources.back().get()});
    }
    BodiesReplay live(std::move(bodies), {}, {});
    recorder.set_surroundings({print_config(config_), [&] { return live.map().published(); }});
    bool started = false;
    live.listen([&](std::size_t body, const SensorSample& sample) {
      if (!started && to_seconds(time_of(sample) - start) >= from_s) {
        started = true;
        ASSERT_TRUE(recorder.start("session"));
      }
      recorder.take(body, sample);
    });
    std::uint64_t turn = 0;
    ASSERT_TRUE(live.run([&](std::size_t body, const BodyUpdate& update) {
      recorder.take_turn(body, update, live.view(), turn++);
    }));
    ASSERT_TRUE(recorder.stop());
    std::jthread writer([&](std::stop_token stop) { recorder.run(stop); });
    writer.request_stop();
  }

  CommandRun replay(const std::string& recording) const {
    ReplayArguments arguments;
    arguments.recordings = {folder_.file("recordings/" + recording)};
    arguments.out = folder_.file("out");
    return on_terminal([&](const Terminal& terminal) { return run_replay(arguments, terminal); });
  }
  nlohmann::json report() const {
    return nlohmann::json::parse(value_of(read_whole_file(folder_.file("out/report.json"))));
  }

  ServerConfig config_;
  TemporaryFolder folder_;
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
};

TEST_F(SessionReplayTest, RecordingFromTheStartGivesTheSameEstimates) {
  run_and_record(0);
  const auto replayed = replay("session");
  ASSERT_EQ(replayed.code, 0) << replayed.err;
  const auto live = report()["live"];
  EXPECT_EQ(live["turns_missed"], 0);
  EXPECT_GT(live["compared"], 500);
  EXPECT_LT(live["worst_m"], 1e-9) << "the configuration passes through text";
}

TEST_F(SessionReplayTest, RecordingOfARunningServerStartsFromItsMap) {
  run_and_record(10);
  const auto replayed = replay("session");
  ASSERT_EQ(replayed.code, 0) << replayed.err;
  for (const auto& body : report()["bodies"]) EXPECT_GT(body["frames_with_pose"], 100);
  EXPECT_EQ(replay("session/drone").code, 0) << "one of its robots";
}

TEST_F(SessionReplayTest, RunWithoutAPoseFailsWithTheReason) {
  config_.map.reference_tag = 4711;  // in no image
  run_and_record(0);
  const auto replayed = replay("session");
  EXPECT_EQ(replayed.code, 1);
  EXPECT_THAT(replayed.err,
              testing::AllOf(testing::HasSubstr("no pose"), testing::HasSubstr("reference tag")));
}

}  // namespace
}  // namespace fiducap
