#include "simulation/room_shape.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>

#include "robot.hpp"
#include "support/results.hpp"

namespace fiducap::simulation {
namespace {

TEST(Room, HallHasUprightTagsOnItsFourWalls) {
  const auto tags = tags_of(room_of("hall"));
  const RoomBox box = box_of(room_of("hall"));
  ASSERT_EQ(tags.size(), 24u);
  std::array<int, 4> on_wall{};
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const RecordedTag& tag = tags[i];
    EXPECT_EQ(tag.tag_id, static_cast<int>(i));
    EXPECT_EQ(tag.edge_m, 0.4);
    EXPECT_GE(tag.X_WT.p.z(), 1.0);
    EXPECT_LE(tag.X_WT.p.z(), 2.2);
    EXPECT_LT((tag.X_WT.q * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
    // On a wall, facing into the room.
    const Eigen::Vector3d normal = tag.X_WT.q * Eigen::Vector3d::UnitZ();
    const std::array<double, 4> distance{
        tag.X_WT.p.x() - box.low.x(), box.high.x() - tag.X_WT.p.x(), tag.X_WT.p.y() - box.low.y(),
        box.high.y() - tag.X_WT.p.y()};
    const auto wall = static_cast<std::size_t>(std::min_element(distance.begin(), distance.end()) -
                                               distance.begin());
    ++on_wall[wall];
    EXPECT_NEAR(distance[wall], 0, 1e-12);
    EXPECT_LT(normal.dot(tag.X_WT.p), 0);
  }
  EXPECT_EQ(on_wall, (std::array<int, 4>{5, 5, 7, 7}));
}

TEST(Room, PresetsHaveTheTagsOfTheirClass) {
  for (const auto& [preset, tags] :
       {std::pair("table", 3u), std::pair("sparse", 3u), std::pair("loop", 36u),
        std::pair("pavillon", 33u), std::pair("ceiling", 100u)})
    EXPECT_EQ(tags_of(room_of(preset)).size(), tags) << preset;
  for (const RecordedTag& tag : tags_of(room_of("table"))) EXPECT_EQ(tag.X_WT.p.z(), 0);
}

TEST(Room, AddsReplacesAndSortsConfiguredTags) {
  RoomConfig room = room_of("table");
  room.tags = {tag_at(40, 0.3), tag_at(1, 0, {1, 2, 3})};
  const auto tags = tags_of(room);
  ASSERT_EQ(tags.size(), 4u);
  EXPECT_EQ(tags[1].X_WT.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(tags[1].edge_m, room.tag_size_m);
  EXPECT_EQ(tags[3].tag_id, 40);
  room.preset = "custom";
  EXPECT_EQ(tags_of(room).size(), 2u);
}

TEST(Room, LoopsCloseAfterTheirLength) {
  for (const LoopShape& shape : {kLoop, kPavillon}) {
    EXPECT_LT((loop_at(shape, 0).p - loop_at(shape, shape.length_m - 1e-9).p).norm(), 1e-6);
    double path = 0;
    for (int i = 0; i < static_cast<int>(100 * shape.length_m); ++i)
      path += (loop_at(shape, 0.01 * (i + 1)).p - loop_at(shape, 0.01 * i).p).head<2>().norm();
    EXPECT_NEAR(path, shape.length_m, 0.01);
  }
}

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

TEST(SimulationConfig, NamesBrokenRulesOfARoom) {
  const DaylightConfig weak{0.5, {0, 0, 0}, {1, 1, 1}};
  const DaylightConfig flat{4, {0, 0, 0}, {1, 0, 1}};
  const std::vector<RecordedTag> twice(2, tag_at(5, 0.1));
  const std::vector<Fault<RoomConfig>> faults{
      {"room.preset", [](RoomConfig& r) { r.preset = "cellar"; }},
      {"room.family", [](RoomConfig& r) { r.family = "qr"; }},
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

TEST(SimulationConfig, NamesBrokenRulesOfABody) {
  const std::vector<Fault<SimulatedBodyConfig>> faults{
      {"body.cameras",
       [](auto& b) {
         b.cameras.clear();
         b.has_imu = false;
       }},
      {"body.cameras[0].model.fu", [](auto& b) { b.cameras[0].model.fu = -3; }},
      {"body.camera.exposure_s", [](auto& b) { b.camera.exposure_s = 0.06; }},
      {"body.trajectory.kind", [](auto& b) { b.trajectory.kind = "teleport"; }},
      {"body.trajectory.file", [](auto& b) { b.trajectory.kind = "file"; }},
      {"body.faults.blackout_s", [](auto& b) { b.faults.blackout_s = 2; }}};
  expect_named(corner_robot("survey"), "body.", faults);
}

}  // namespace
}  // namespace fiducap::simulation
