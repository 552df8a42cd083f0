#include "daemon/bodies/body_setup.hpp"

#include <gmock/gmock.h>

#include <deque>
#include <stdexcept>

#include "base/gravity.hpp"
#include "capture/recording/recording_writer.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/map_start.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "support/fake_clock.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/daemon/fake_body.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;

BodyConfig simulated_body() {
  BodyConfig robot;
  robot.name = "robot";
  robot.source.type = SourceType::kSimulator;
  return robot;
}

TEST(BodySetup, KeepsTheTrueExtrinsicsOfASimulatedCamera) {
  ServerConfig config;
  BodyConfig robot = simulated_body();
  CameraConfig camera;
  camera.mount.model = {752, 480, 450, 450, 376, 240};
  camera.mount.X_BV.p = {0.1, 0, 0};
  camera.mount.position_sigma_m = 0.02;
  camera.mount.rotation_sigma_rad = 0.02;
  robot.cameras = {camera};
  auto setup = value_of(read_body_setup(robot, config.simulation));

  const Pose learned{Eigen::Quaterniond::Identity(), {0.11, 0, 0}};
  use_learned({{"robot", 0, learned}}, "robot", setup.sensors);
  ASSERT_EQ(setup.sensors.cameras.front().X_BV.p, learned.p);

  const FakeClock clock{instant_from_ns(1)};
  const auto source = value_of(open_source(
      robot, {}, setup, {.room = config.simulation, .clock = clock, .motion = nullptr}));
  const SimulatedTruth truth = truth_of(*source, config);
  ASSERT_EQ(truth.X_BV.size(), 1U);
  EXPECT_EQ(truth.X_BV.front().p, camera.mount.X_BV.p);
}

TEST(BodySetup, ReadsGravityFromANumberOrThePlace) {
  const auto gravity_of = [](const std::string& site) {
    const auto config = value_of(parse_config("site: " + site + "\n", "test.yaml"));
    const auto again = value_of(parse_config(print_config(config), "printed.yaml"));
    EXPECT_EQ(config.site.configured_gravity(), again.site.configured_gravity());
    return again.site.configured_gravity();
  };
  EXPECT_EQ(gravity_of("{}"), std::nullopt);
  EXPECT_EQ(gravity_of("{gravity_m_s2: 9.776}"), 9.776);
  EXPECT_EQ(gravity_of("{latitude_deg: 19.4, height_m: 2240}"), normal_gravity(19.4, 2240));
}

TEST(BodySetup, WritesGravityToTheRecording) {
  const TemporaryFolder folder;
  BodyConfig robot = simulated_body();
  robot.cameras.resize(1);
  robot.cameras.front().mount.model = {752, 480, 450, 450, 376, 240};
  const auto read_back = [&](const SiteConfig& site, const std::string& name) {
    auto setup = value_of(read_body_setup(robot, {}, site));
    RecordingInfo info = recording_of(setup.sensors, {}, std::nullopt);
    info.folder = folder.file(name);
    auto writer = value_of(RecordingWriter::create(info));
    EXPECT_TRUE(writer.finish());
    return offline_setup(value_of(read_recording_info(info.folder))).sensors;
  };
  const BodySensors usual = read_back({}, "usual");
  EXPECT_FALSE(usual.is_gravity_known());
  EXPECT_EQ(usual.gravity_sigma_m_s2, kUsualGravitySigma_m_s2);
  const BodySensors configured = read_back({std::nullopt, 19.4, 2240}, "configured");
  EXPECT_EQ(configured.gravity_m_s2, normal_gravity(19.4, 2240)) << "to the last bit";
  EXPECT_EQ(configured.gravity_sigma_m_s2, kGivenGravitySigma_m_s2);
}

TEST(BodySetup, ReadsTheCorrectionOfAnImu) {
  const TemporaryFolder folder;
  ImuCorrection calibrated;
  calibrated.accel_matrix(2, 2) = 0.97;
  BodyConfig robot = simulated_body();
  robot.imu_correction =
      folder.write("imu_correction.yaml", to_imu_correction_yaml(calibrated, ""));
  const auto setup = value_of(read_body_setup(robot, {}));
  ASSERT_TRUE(setup.sensors.imu && setup.sensors.imu->correction);
  EXPECT_EQ(setup.sensors.imu->correction->accel_matrix, calibrated.accel_matrix);
  robot.imu_correction = folder.file("none.yaml");
  EXPECT_THAT(error_of(read_body_setup(robot, {})), testing::HasSubstr("none.yaml"));
}

class ReopeningSourceTest : public testing::Test {
 protected:
  using Opened = Expected<std::unique_ptr<SensorSource>>;
  enum class End { kUnplugged, kThrows, kOver };

  /// Gives a number of readings, one per second.
  Opened device(int readings, End end) {
    return made([this, readings, end](int turn) -> MadeSource::Sample {
      if (turn < readings) {
        clock_.advance(1s);
        return ImuSample{};
      }
      if (end == End::kThrows) throw std::runtime_error("driver bug");
      if (end == End::kOver) return std::nullopt;
      return fail(ErrorCode::kClosed, "gives no more images");
    });
  }
  void build(Opened first) {
    source_ = std::make_unique<ReopeningSource>(
        std::move(first),
        [this]() -> Opened {
          opened_at_.push_back(clock_.now() - Instant{});
          if (next_.empty()) return fail(ErrorCode::kNotFound, "no such device");
          Opened one = std::move(next_.front());
          next_.pop_front();
          return one;
        },
        ReopeningSource::Listener{[this](const Error& why) { events_.push_back(why.what); },
                                  [this] { events_.push_back("back"); }},
        clock_);
  }
  bool gives_a_sample() {
    const auto sample = source_->next(stop_.get_token());
    return sample && sample->has_value();
  }
  bool gives_samples(int count) {
    while (count > 0 && gives_a_sample()) --count;
    return count == 0;
  }

  FakeClock clock_;
  std::deque<Opened> next_;
  std::vector<Duration> opened_at_;
  std::vector<std::string> events_;
  std::stop_source stop_;
  std::unique_ptr<ReopeningSource> source_;
};

TEST_F(ReopeningSourceTest, ReopensAnUnpluggedDevice) {
  next_.push_back(device(5, End::kUnplugged));
  build(device(1, End::kUnplugged));
  EXPECT_TRUE(gives_a_sample());
  EXPECT_THAT(events_, IsEmpty());
  EXPECT_TRUE(gives_a_sample()) << "of the second device";
  EXPECT_THAT(events_, ElementsAre("gives no more images")) << "not after a single sample";
  EXPECT_TRUE(gives_samples(4));
  EXPECT_THAT(events_, ElementsAre("gives no more images", "back"));
  EXPECT_THAT(opened_at_, ElementsAre(Duration(1250ms)));
}

TEST_F(ReopeningSourceTest, WaitsForAMissingDevice) {
  next_.push_back(fail(ErrorCode::kNotFound, "no such device"));
  next_.push_back(fail(ErrorCode::kUnavailable, "is busy"));
  next_.push_back(device(4, End::kOver));
  build(fail(ErrorCode::kNotFound, "no such device"));
  EXPECT_TRUE(gives_samples(4));
  EXPECT_THAT(events_, ElementsAre("no such device", "is busy", "back")) << "each reason once";
}

TEST_F(ReopeningSourceTest, GrowsPausesOfADeviceThatFailsAgain) {
  for (int i = 0; i < 12; ++i) next_.push_back(device(1, End::kUnplugged));
  build(device(1, End::kUnplugged));
  EXPECT_TRUE(gives_samples(13));
  EXPECT_THAT(events_, testing::AllOf(testing::SizeIs(12), testing::Each("gives no more images")));
  ASSERT_EQ(opened_at_.size(), 12U);
  EXPECT_EQ(opened_at_[1] - opened_at_[0], 1500ms) << "a sample for a second, a pause of 500 ms";
  EXPECT_EQ(opened_at_[11] - opened_at_[10], 31s);
}

TEST_F(ReopeningSourceTest, GrowsPausesToHalfAMinuteAndResetsThem) {
  for (int i = 0; i < 10; ++i) next_.push_back(fail(ErrorCode::kNotFound, "no such device"));
  next_.push_back(device(61, End::kUnplugged));
  next_.push_back(device(1, End::kOver));
  build(device(0, End::kUnplugged));
  EXPECT_TRUE(gives_samples(61));
  ASSERT_EQ(opened_at_.size(), 11U);
  EXPECT_EQ(opened_at_[1] - opened_at_[0], 500ms);
  EXPECT_EQ(opened_at_[10] - opened_at_[9], 30s);
  EXPECT_TRUE(gives_a_sample());
  EXPECT_EQ(opened_at_[11] - opened_at_[10], 61s + 250ms);
}

TEST_F(ReopeningSourceTest, TreatsAnExceptionAsALoss) {
  next_.push_back(device(4, End::kOver));
  build(device(1, End::kThrows));
  EXPECT_TRUE(gives_samples(5));
  EXPECT_THAT(events_, ElementsAre("driver bug", "back"));
}

TEST_F(ReopeningSourceTest, EndsWithItsSource) {
  build(device(1, End::kOver));
  EXPECT_TRUE(gives_a_sample());
  EXPECT_FALSE(gives_a_sample());
  EXPECT_THAT(opened_at_, IsEmpty());
}

TEST_F(ReopeningSourceTest, EndsTheWaitWhenStopped) {
  build(fail(ErrorCode::kNotFound, "no such device"));
  stop_.request_stop();
  EXPECT_FALSE(gives_a_sample());
}

}  // namespace
}  // namespace fiducap
