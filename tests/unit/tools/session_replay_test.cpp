// What the server's recorder writes, replayed by `fiducap replay`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "daemon/bodies/body_setup.hpp"
#include "daemon/recording/session_recorder.hpp"
#include "pipeline/replay/bodies_replay.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"
#include "support/fake_clock.hpp"
#include "support/temporary_folder.hpp"
#include "tools/replay/replay_verbs.hpp"

namespace fiducap {
namespace {

/// Two simulated robots in one room, as a server has them, with a recorder at work from a time on.
class SessionReplayTest : public testing::Test {
 protected:
  static constexpr double kSeconds = 20;

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
      robot.trajectory.duration_s = kSeconds;
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
    for (const BodyConfig& body : config_.bodies) {
      const auto setup = read_body_setup(body, config_.simulation, config_.site);
      ASSERT_TRUE(setup);
      auto robot = body.source.simulator;
      robot.cameras = setup->sensors.cameras;
      sources.push_back(*simulation::make_simulated_source(config_.simulation, robot,
                                                           instant_from_ns(kStart_ns), nullptr));
      recorder.add_body(body.name, recording_of(setup->sensors, config_.tags, std::nullopt));
      bodies.push_back(
          {body.id, body.name, pipeline_setup(config_, body, *setup), sources.back().get()});
    }
    BodiesReplay live(std::move(bodies), {}, {});
    recorder.set_surroundings({print_config(config_), [&] { return live.map().published(); }});
    const auto start_when_due = [&](Instant at) {
      if (started_ || to_seconds(at - instant_from_ns(kStart_ns)) < from_s) return;
      started_ = true;
      ASSERT_TRUE(recorder.start("session"));
    };
    live.listen([&](std::size_t body, const SensorSample& sample) {
      start_when_due(time_of(sample));
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

  int replay(const std::vector<std::string>& recordings) {
    ReplayArguments arguments;
    arguments.recordings = recordings;
    arguments.out = folder_.file("out");
    return run_replay(arguments, {out_, err_});
  }

  static constexpr std::int64_t kStart_ns = 1'000'000'000'000;
  ServerConfig config_;
  TemporaryFolder folder_;
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
  bool started_{false};
  std::ostringstream out_;
  std::ostringstream err_;
};

TEST_F(SessionReplayTest, ASessionFromTheStartGivesTheSameEstimates) {
  run_and_record(0);
  ASSERT_EQ(replay({folder_.file("recordings/session")}), 0) << err_.str();
  const auto report = read_whole_file(folder_.file("out/report.json"));
  ASSERT_TRUE(report);
  const auto live = nlohmann::json::parse(*report)["live"];
  EXPECT_EQ(live["turns_missed"], 0);
  EXPECT_GT(live["compared"], 500);
  EXPECT_LT(live["worst_m"], 1e-9) << "the configuration passes through text";
}

TEST_F(SessionReplayTest, ARecordingOfARunningServerStartsFromTheMapItHad) {
  run_and_record(10);
  ASSERT_EQ(replay({folder_.file("recordings/session")}), 0) << err_.str();
  const auto report = read_whole_file(folder_.file("out/report.json"));
  ASSERT_TRUE(report);
  const auto json = nlohmann::json::parse(*report);
  for (const auto& body : json["bodies"]) EXPECT_GT(body["frames_with_pose"], 100);
  ASSERT_EQ(replay({folder_.file("recordings/session/drone")}), 0) << "one robot out of it, too";
}

TEST_F(SessionReplayTest, ARunWithoutAPoseIsNotDoneAndSaysWhy) {
  config_.map.reference_tag = 4711;  // which hangs nowhere
  run_and_record(0);
  EXPECT_EQ(replay({folder_.file("recordings/session")}), 1);
  EXPECT_THAT(err_.str(), testing::HasSubstr("no pose"));
  EXPECT_THAT(err_.str(), testing::HasSubstr("reference tag"));
}

}  // namespace
}  // namespace fiducap
