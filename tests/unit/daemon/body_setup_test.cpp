#include "daemon/bodies/body_setup.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/gravity.hpp"
#include "capture/recording/recording_writer.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/map_start.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "support/fake_clock.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

TEST(BodySetup, WhatWasLearnedAboutACameraDoesNotMoveTheSimulatedOne) {
  ServerConfig config;
  BodyConfig robot;
  robot.name = "robot";
  robot.source.type = SourceType::kSimulator;
  CameraConfig camera;
  camera.mount.model = {752, 480, 450, 450, 376, 240};
  camera.mount.X_BV.p = {0.1, 0, 0};
  camera.mount.position_sigma_m = 0.02;
  camera.mount.rotation_sigma_rad = 0.02;
  robot.cameras = {camera};
  auto setup = read_body_setup(robot, config.simulation);
  ASSERT_TRUE(setup) << setup.error().text();

  const Pose learned{Eigen::Quaterniond::Identity(), {0.11, 0, 0}};
  use_learned({{"robot", 0, learned}}, "robot", setup->sensors);
  ASSERT_EQ(setup->sensors.cameras.front().X_BV.p, learned.p);

  const FakeClock clock{instant_from_ns(1)};
  const auto source = open_source(robot, {}, *setup,
                                  {.room = config.simulation, .clock = clock, .motion = nullptr});
  ASSERT_TRUE(source) << source.error().text();
  const SimulatedTruth truth = truth_of(**source, config);
  ASSERT_EQ(truth.X_BV.size(), 1U);
  EXPECT_EQ(truth.X_BV.front().p, camera.mount.X_BV.p);
}

TEST(BodySetup, GravityIsToldByANumberOrByThePlace) {
  const auto told = [](const std::string& site) {
    const auto config = parse_config("site: " + site + "\n", "test.yaml");
    if (!config) throw std::runtime_error(config.error().front().text());
    const auto again = parse_config(print_config(*config), "printed.yaml");
    EXPECT_EQ(config->site.configured_gravity(), again->site.configured_gravity());
    return again->site.configured_gravity();
  };
  EXPECT_EQ(told("{}"), std::nullopt);
  EXPECT_EQ(told("{gravity_m_s2: 9.776}"), 9.776);
  EXPECT_EQ(told("{latitude_deg: 19.4, height_m: 2240}"), normal_gravity(19.4, 2240));
}

TEST(BodySetup, GravityThatIsToldIsInTheRecordingToo) {
  const TemporaryFolder folder;
  BodyConfig robot;
  robot.name = "robot";
  robot.source.type = SourceType::kSimulator;
  robot.cameras.resize(1);
  robot.cameras.front().mount.model = {752, 480, 450, 450, 376, 240};
  const auto read_back = [&](const SiteConfig& site, const std::string& name) {
    auto setup = read_body_setup(robot, {}, site);
    if (!setup) throw std::runtime_error(setup.error().text());
    RecordingInfo info = recording_of(setup->sensors, {}, std::nullopt);
    info.folder = folder.file(name);
    auto writer = RecordingWriter::create(info);
    if (!writer || !writer->finish()) throw std::runtime_error("not written");
    const auto read = read_recording_info(info.folder);
    if (!read) throw std::runtime_error(read.error().text());
    return offline_setup(*read).sensors;
  };
  const BodySensors untold = read_back({}, "untold");
  EXPECT_FALSE(untold.is_gravity_known());
  EXPECT_EQ(untold.gravity_sigma_m_s2, kUsualGravitySigma_m_s2);
  const BodySensors told = read_back({std::nullopt, 19.4, 2240}, "told");
  EXPECT_EQ(told.gravity_m_s2, normal_gravity(19.4, 2240)) << "to the last bit";
  EXPECT_EQ(told.gravity_sigma_m_s2, kGivenGravitySigma_m_s2);
}

TEST(BodySetup, AnImuComesWithItsCorrection) {
  const TemporaryFolder folder;
  ImuCorrection calibrated;
  calibrated.accel_matrix(2, 2) = 0.97;
  BodyConfig robot;
  robot.name = "robot";
  robot.source.type = SourceType::kSimulator;
  robot.imu_correction =
      folder.write("imu_correction.yaml", to_imu_correction_yaml(calibrated, ""));
  auto setup = read_body_setup(robot, {});
  ASSERT_TRUE(setup) << setup.error().text();
  ASSERT_TRUE(setup->sensors.imu && setup->sensors.imu->correction);
  EXPECT_EQ(setup->sensors.imu->correction->accel_matrix, calibrated.accel_matrix);

  robot.imu_correction = folder.file("none.yaml");
  setup = read_body_setup(robot, {});
  ASSERT_FALSE(setup);
  EXPECT_THAT(setup.error().text(), testing::HasSubstr("none.yaml"));
}

}  // namespace
}  // namespace fiducap
