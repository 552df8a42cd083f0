// `fiducap replay` of what the server's recorder writes, and with `--resolve`.
#include <gmock/gmock.h>

#include <algorithm>
#include <thread>

#include <nlohmann/json.hpp>

#include "capture/recording/recording_writer.hpp"
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
#include "unit/detection/rendered_wall.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using Words = std::vector<std::string>;

/// Two simulated robots in one room, as a server has them; the recorder starts later.
class SessionReplayTest : public VerbTest<ReplayArguments> {
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

  void replay(const std::string& recording, int exit_code = kExitOk) {
    arguments_.recordings = {folder_.file("recordings/" + recording)};
    arguments_.out = folder_.file("out");
    run(run_replay, exit_code);
  }

  ServerConfig config_;
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
};

TEST_F(SessionReplayTest, RecordingOfARunningServerStartsFromItsMap) {
  run_and_record(10);
  replay("session");
  const auto report = nlohmann::json::parse(content_of(folder_.file("out/report.json")));
  for (const auto& body : report["bodies"]) EXPECT_GT(body["frames_with_pose"], 100);
  replay("session/drone");  // one of its robots
}

TEST_F(SessionReplayTest, RunWithoutAPoseFailsWithTheReason) {
  config_.map.reference_tag = 4711;  // in no image
  run_and_record(0);
  replay("session", kExitFailed);
  EXPECT_THAT(err_, testing::AllOf(HasSubstr("no pose"), HasSubstr("reference tag")));
}

class ResolveTest : public testing::Test {
 protected:
  /// @return stdout, or stderr of a failure
  static std::string run(const Words& words, int exit_code = kExitOk) {
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, exit_code) << run.err;
    return exit_code == kExitOk ? run.out : run.err;
  }
  void simulate(const std::string& name, const Words& more = {}) const {
    Words words{"simulate", "--room", "table", "--seconds", "8", "--out", folder_.file(name)};
    words.insert(words.end(), more.begin(), more.end());
    run(words);
  }
  std::string replay(const Words& more, int exit_code = kExitOk) const {
    Words words{"replay", folder_.file("table"), "--out", folder_.file("out")};
    words.insert(words.end(), more.begin(), more.end());
    return run(words, exit_code);
  }
  [[nodiscard]] std::size_t lines(const std::string& name) const {
    const std::string text = content_of(folder_.file("out/" + name));
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  }

  TemporaryFolder folder_;
};

TEST_F(ResolveTest, IsTheOnlyWayWithoutAnImu) {
  simulate("table", {"--no-imu"});
  replay({});
  EXPECT_GT(lines("table.covariance.csv"), 80U);
  EXPECT_GT(lines("table.live.tum"), 0U);
}

TEST_F(ResolveTest, StartsFromAStoredMapAndWritesPosesCovariancesAndLivePoses) {
  simulate("table");
  const std::string store = folder_.file("hall.map");
  EXPECT_THAT(replay({"--resolve", "--store", store}, kExitFailed), HasSubstr("is not there"));
  simulate("before", {"--seed", "5"});
  run({"map", "build", folder_.file("before"), "--store", store});
  replay({"--resolve", "--store", store});
  const std::size_t poses = lines("table.tum");
  EXPECT_GT(poses, 80U) << "20 images per second, from when the start is final";
  EXPECT_NEAR(static_cast<double>(lines("table.covariance.csv")), static_cast<double>(poses), 1)
      << "and a header";
  EXPECT_GT(lines("table.live.tum"), 80U);
  const auto json = nlohmann::json::parse(
      run({"evaluate", folder_.file("out/table.tum"), folder_.file("table"), "--json"}));
  EXPECT_LT(json["pose"]["position_rmse_m"], 0.01);
  EXPECT_THAT(replay({"--map", "a.yaml", "--store", "b.map"}, kExitFailed), HasSubstr("not both"));
}

using ReplayReasonTest = ResolveTest;

TEST_F(ReplayReasonTest, CornersTurnedByHalfATurnAreNamed) {
  simulate("table");
  const std::string corners = "table/mav0/tags0/data.csv";
  std::istringstream lines(content_of(folder_.file(corners)));
  std::string turned;
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::string> fields;
    std::istringstream row(line);
    for (std::string field; std::getline(row, field, ',');) fields.push_back(field);
    if (fields.front()[0] != '#') std::rotate(fields.begin() + 3, fields.begin() + 7, fields.end());
    for (const std::string& field : fields)
      turned += field + (&field == &fields.back() ? "\n" : ",");
  }
  folder_.write(corners, turned);
  EXPECT_THAT(replay({"--map", folder_.file("table/truth/tags.csv")}, kExitFailed),
              AllOf(HasSubstr("most sightings of tags contradict the rest: all tags are turned by "
                              "half a turn"),
                    HasSubstr("tags.family: DICT_APRILTAG_36h11")));
}

TEST_F(ReplayReasonTest, MirroredImagesAreNamed) {
  RenderedWall wall;
  RecordingInfo info;
  info.folder = folder_.file("table");
  info.name = "table";
  info.cameras.emplace_back().model = simulation::small_camera();
  info.has_images = {true};
  info.has_corners = {false};
  auto writer = value_of(RecordingWriter::create(info));
  for (std::uint64_t k = 0; k < 4; ++k) {
    auto image = std::make_shared<GrayImage>(*wall.photograph(k));
    for (auto row = image->pixels.begin(); row != image->pixels.end(); row += image->width)
      std::reverse(row, row + image->width);
    const auto at = instant_from_ns(1'000'000'000'000 + 50'000'000 * static_cast<std::int64_t>(k));
    ASSERT_TRUE(writer.write(CameraFrame{0, at, image}));
  }
  ASSERT_TRUE(writer.finish());
  EXPECT_THAT(replay({}, kExitFailed),
              HasSubstr("4 images, no pose: no tag was found in any of them: the images are "
                        "mirrored: 6 tags are found when they are flipped"));
  EXPECT_THAT(run({"map", "build", folder_.file("table"), "--store", folder_.file("hall.map")},
                  kExitFailed),
              HasSubstr("the images are mirrored"));
}

}  // namespace
}  // namespace fiducap
