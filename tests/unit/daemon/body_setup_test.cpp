#include "daemon/bodies/body_setup.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/map_start.hpp"
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
