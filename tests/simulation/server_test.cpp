// The whole server on loopback, in real time.
#include <gmock/gmock.h>

#include <filesystem>

#include "capture/recording/recording.hpp"
#include "mapping/store/map_store.hpp"
#include "support/running_server.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// A running server with a client.
struct Served {
  explicit Served(const ServerConfig& config, const ServerOptions& options = {})
      : server(config, options), client(server.client_options()) {}

  template <typename Each>
  bool shows(std::chrono::seconds timeout, Each each) {
    return follow(client, timeout, each);
  }
  bool tracks(std::size_t count, std::chrono::seconds timeout) {
    return shows(timeout, [&](const Frame& frame) { return all_tracked(frame, count); });
  }

  RunningServer server;
  Client client;
};

TEST(ServerOnLoopback, ObeysAnOperatorAndRecords) {
  const TemporaryFolder folder;
  ServerConfig config = corner_demo();
  config.operators.token = "correct horse";
  config.recorder.folder = folder.file("recordings");
  Served served(config);
  ASSERT_TRUE(served.tracks(3, 20s));
  EXPECT_FALSE(Control(served.server.control_options("correct horsf")).set_enabled(2, false));
  Control control(served.server.control_options("correct horse"));
  ASSERT_TRUE(control.start_recording("flight"));
  ASSERT_TRUE(control.rename(1, "eagle"));
  ASSERT_TRUE(control.set_enabled(2, false));
  EXPECT_TRUE(served.shows(5s, [](const Frame& frame) {
    return all_tracked(frame, 2) && frame.bodies[0].name == "eagle" && frame.bodies[1].id == 3;
  }));
  ASSERT_TRUE(control.set_enabled(2, true));
  EXPECT_TRUE(served.tracks(3, 5s)) << "it was tracked while disabled";
  std::uint64_t seen = 0;  // frames: every robot gets some images meanwhile
  EXPECT_TRUE(served.shows(20s, [&](const Frame&) { return ++seen == 100; }));
  ASSERT_TRUE(control.stop_recording());
  served.server.stop();
  for (const char* body : {"drone", "rover", "walker"}) {
    const auto info =
        value_of(read_recording_info(folder.file(std::string("recordings/flight/") + body)));
    EXPECT_TRUE(info.imu);
    EXPECT_TRUE(info.has_corners.at(0));
  }
}

TEST(ServerOnLoopback, EndsWithinASecond) {
  Served served(corner_demo());
  ASSERT_TRUE(served.shows(10s, [](const Frame&) { return true; }));
  EXPECT_LT(served.server.stop(), 1s);
  EXPECT_TRUE(served.server.clean());
}

TEST(ServerOnLoopback, EndsWhenEverySourceHasEnded) {
  ServerConfig config = corner_demo();
  for (auto& body : config.bodies) body.source.simulator.trajectory.duration_s = 0.5;
  RunningServer server(config, {true, false, {}});
  server.wait();
  EXPECT_TRUE(server.clean());
}

TEST(ServerOnLoopback, ContinuesWhenOneSourceEnds) {
  ServerConfig config = corner_demo();
  config.bodies[1].source.simulator.trajectory.duration_s = 0.5;
  EXPECT_TRUE(Served(config).shows(30s, [](const Frame& frame) {
    return frame.bodies.size() == 3 && frame.bodies[1].tracking == Tracking::kLost &&
           !frame.bodies[1].valid && frame.bodies[0].valid && frame.bodies[2].valid;
  }));
}

TEST(ServerOnLoopback, ServesTheOthersWhenOneCameraIsMissing) {
  ServerConfig config = corner_demo();
  config.bodies[2].source.type = SourceType::kCamera;
  config.bodies[2].source.camera.open = "/dev/no-such-camera";
  EXPECT_TRUE(Served(config).shows(30s, [](const Frame& frame) {
    return frame.bodies.size() == 3 && frame.bodies[2].tracking == Tracking::kLost &&
           frame.bodies[0].valid;
  }));
}

/// A device that is unplugged after some readings.
class Unplugged final : public SensorSource {
 public:
  explicit Unplugged(std::unique_ptr<SensorSource> device) : device_(std::move(device)) {}
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    if (left_-- == 0) return fail(ErrorCode::kClosed, "gives no more images");
    return device_->next(std::move(stop));
  }

 private:
  std::unique_ptr<SensorSource> device_;
  int left_{1000};
};

TEST(ServerOnLoopback, TracksARobotAgainWhenItsDeviceIsBack) {
  int opened = 0;
  ServerOptions options;
  options.source = [&](const std::string& body,
                       std::unique_ptr<SensorSource> device) -> std::unique_ptr<SensorSource> {
    if (body != "rover" || opened++ > 0) return device;
    return std::make_unique<Unplugged>(std::move(device));
  };
  Served served(corner_demo(), options);
  ASSERT_TRUE(served.tracks(3, 30s));
  ASSERT_TRUE(served.shows(30s, [](const Frame& frame) {
    return frame.bodies[1].tracking == Tracking::kLost && frame.bodies[0].valid;
  }));
  EXPECT_TRUE(served.tracks(3, 30s));
}

TEST(ServerOnLoopback, KeepsTheMapForTheNextRun) {
  const TemporaryFolder folder;
  ServerConfig config = corner_demo();
  config.map.store = folder.file("map.sqlite");
  config.map.builder.commit_period_s = 0.2;
  ASSERT_TRUE(Served(config).shows(30s, [](const Frame& frame) { return frame.map_version >= 1; }));
  auto store = value_of(MapStore::open(config.map.store));
  const auto map = value_of(store.newest());
  EXPECT_GE(map.version, 1);
  EXPECT_NE(map.find(0), nullptr) << "the reference tag is the first to be known";
  EXPECT_FALSE(store.extrinsics()->empty());
}

/// Errors of `Server::build`.
class ServerBuildTest : public testing::Test {
 protected:
  std::string error() {
    const auto built = Server::build(config_, {}, clock_);
    return built ? "" : built.error().text();
  }
  SystemClock clock_;
  ServerConfig config_{corner_demo()};
};

TEST_F(ServerBuildTest, NamesAPortThatIsTaken) {
  RunningServer taken(config_);
  config_.streaming.web.port = taken->ports().web;
  EXPECT_THAT(error(), HasSubstr(std::to_string(config_.streaming.web.port)));
  config_.streaming.optional = {"web"};
  EXPECT_EQ(error(), "");
}

TEST_F(ServerBuildTest, NamesAMissingRecording) {
  config_.bodies[0].source.type = SourceType::kRecording;
  config_.bodies[0].source.recording.folder = "/no/such/recording";
  EXPECT_THAT(error(), HasSubstr("/no/such/recording"));
}

TEST_F(ServerBuildTest, NamesADamagedMapAndKeepsIt) {
  const TemporaryFolder folder;
  config_.map.store = folder.write("map.sqlite", std::string(5000, 'x'));
  EXPECT_THAT(error(), HasSubstr("map.sqlite"));
  EXPECT_EQ(std::filesystem::file_size(config_.map.store), 5000u);
}

TEST_F(ServerBuildTest, NeedsABody) {
  config_.bodies.clear();
  EXPECT_THAT(error(), HasSubstr("at least one body"));
}

TEST_F(ServerBuildTest, FailsWhenNoSourceCanBeOpened) {
  config_.bodies.resize(1);
  config_.bodies[0].source.type = SourceType::kCamera;
  config_.bodies[0].source.camera.open = "/no/such/video.mp4";
  EXPECT_THAT(error(), HasSubstr("/no/such/video.mp4"));
}

}  // namespace
}  // namespace fiducap
