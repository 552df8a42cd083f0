#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "robot.hpp"
#include "support/results.hpp"

namespace fiducap::simulation {
namespace {

/// One change of a valid configuration and the path that it breaks.
template <typename Config>
struct Fault {
  const char* path;
  std::function<void(Config&)> change;
};

template <typename Config>
void expect_named(const Config& valid, const std::string& root,
                  const std::vector<Fault<Config>>& faults) {
  for (const auto& [path, change] : faults) {
    Config config = valid;
    change(config);
    EXPECT_THAT(paths_of(check(config, root)), testing::ElementsAre(path));
  }
}

TEST(SimulationConfig, IsValidByDefault) {
  EXPECT_TRUE(check(RoomConfig{}, "room.").empty());
  EXPECT_TRUE(check(corner_robot("survey"), "body.").empty());
}

TEST(SimulationConfig, NamesEveryBrokenRuleOfARoom) {
  const DaylightConfig weak{0.5, {0, 0, 0}, {1, 1, 1}};
  const DaylightConfig flat{4, {0, 0, 0}, {1, 0, 1}};
  const std::vector<RecordedTag> twice(2, tag_at(5, 0.1));
  const std::vector<Fault<RoomConfig>> faults{
      {"room.preset", [](RoomConfig& r) { r.preset = "cellar"; }},
      {"room.family", [](RoomConfig& r) { r.family = "qr"; }},
      {"room.tag_size_m", [](RoomConfig& r) { r.tag_size_m = 0; }},
      {"room.gravity_m_s2", [](RoomConfig& r) { r.gravity_m_s2 = -1; }},
      {"room.daylight.factor", [&](RoomConfig& r) { r.daylight = weak; }},
      {"room.daylight.high", [&](RoomConfig& r) { r.daylight = flat; }},
      {"room.texture", [](RoomConfig& r) { r.texture = "velvet"; }},
      {"room.tags", [](RoomConfig& r) { r.preset = "custom"; }},
      {"room.tags", [](RoomConfig& r) { r.tags = {tag_at(587, 0.1)}; }},
      {"room.tags[1].tag_id", [&](RoomConfig& r) { r.tags = twice; }},
      {"room.tags[0].edge_m", [](RoomConfig& r) { r.tags = {tag_at(5, -0.1)}; }},
      {"room.tags[0].X_WT", [](RoomConfig& r) {
         r.tags = {tag_at(5, 0.1)};
         r.tags[0].X_WT.q.w() = 2;
       }}};
  expect_named(RoomConfig{}, "room.", faults);
}

TEST(SimulationConfig, NamesEveryBrokenRuleOfABody) {
  const std::vector<Fault<SimulatedBodyConfig>> faults{
      {"body.cameras",
       [](auto& b) {
         b.cameras.clear();
         b.has_imu = false;
       }},
      {"body.cameras[0].rate_hz", [](auto& b) { b.cameras[0].rate_hz = 0; }},
      {"body.cameras[0].model.fu", [](auto& b) { b.cameras[0].model.fu = -3; }},
      {"body.imu.noise.rate_hz", [](auto& b) { b.imu.noise.rate_hz = 0; }},
      {"body.imu.gyro_bias",
       [](auto& b) { b.imu.gyro_bias.x() = std::numeric_limits<double>::quiet_NaN(); }},
      {"body.camera.pixel_noise", [](auto& b) { b.camera.pixel_noise = -1; }},
      {"body.camera.exposure_s", [](auto& b) { b.camera.exposure_s = 0.06; }},
      {"body.camera.exposure_lag_s", [](auto& b) { b.camera.exposure_lag_s = -1; }},
      {"body.trajectory.kind", [](auto& b) { b.trajectory.kind = "teleport"; }},
      {"body.trajectory.file", [](auto& b) { b.trajectory.kind = "file"; }},
      {"body.trajectory.speed", [](auto& b) { b.trajectory.speed = 0; }},
      {"body.faults.drop_image", [](auto& b) { b.faults.drop_image = 1.5; }},
      {"body.faults.occlude_corner", [](auto& b) { b.faults.occlude_corner = -0.1; }},
      {"body.faults.image_stamp_error_s", [](auto& b) { b.faults.image_stamp_error_s = 2; }},
      {"body.faults.imu_stamp_jitter_s", [](auto& b) { b.faults.imu_stamp_jitter_s = -0.001; }},
      {"body.faults.saturation_at_s", [](auto& b) { b.faults.saturation_at_s = -1; }},
      {"body.faults.saturation_s", [](auto& b) { b.faults.saturation_s = -1; }},
      {"body.faults.saturated_gyro_rad_s", [](auto& b) { b.faults.saturated_gyro_rad_s = 0; }},
      {"body.faults.saturated_accel_m_s2", [](auto& b) { b.faults.saturated_accel_m_s2 = 0; }},
      {"body.faults.blackout_s", [](auto& b) { b.faults.blackout_s = 2; }}};
  expect_named(corner_robot("survey"), "body.", faults);
}

}  // namespace
}  // namespace fiducap::simulation
