#include "simulation/room_shape.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "robot.hpp"

namespace fiducap::simulation {
namespace {

struct Character {
  double tags_per_frame{};
  double empty_share{};
  double longest_gap_s{};
  double shortest_side_px{1e9};
};

Character character_of(const std::string& preset, const std::string& kind, double duration_s,
                       std::uint64_t seed) {
  SimulatedBodyConfig body = corner_robot(kind, seed);
  body.has_imu = false;
  body.trajectory.duration_s = duration_s;
  const auto source =
      make_simulated_source(room_of(preset), body, instant_from_ns(0), nullptr).value();
  const auto frames = only<CornerFrame>(run_out(*source));
  Character c;
  double gap = 0;
  for (const CornerFrame& frame : frames) {
    c.tags_per_frame += static_cast<double>(frame.tags.size()) / static_cast<double>(frames.size());
    if (frame.tags.empty()) c.empty_share += 1.0 / static_cast<double>(frames.size());
    gap = frame.tags.empty() ? gap + 0.05 : 0;
    c.longest_gap_s = std::max(c.longest_gap_s, gap);
    for (const TagSighting& tag : frame.tags) {
      for (std::size_t i = 0; i < 4; ++i) {
        c.shortest_side_px =
            std::min(c.shortest_side_px, (tag.corners_px[i] - tag.corners_px[(i + 1) % 4]).norm());
      }
    }
  }
  return c;
}

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

TEST(Room, SurveyInTheHallHasTagsInView) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Character c = character_of("hall", "survey", 120, seed);
    EXPECT_LE(c.empty_share, 0.03) << "seed " << seed;
    EXPECT_GE(c.tags_per_frame, 2.0) << "seed " << seed;
    EXPECT_GE(c.shortest_side_px, 14.0) << "seed " << seed;  // 16 px less corner noise
  }
}

struct ClassOfData {
  const char* name;
  double duration_s;
  double tags_per_frame, tolerance, empty_below;
};

// The classes of data/, from their descriptions; the spread is that of seeds 1..10.
TEST(Room, IsLikeItsClassOfData) {
  for (const ClassOfData& c : {ClassOfData{"table", 60, 2.8, 0.25, 1e-9},
                               {"loop", 124, 1.85, 0.25, 0.03},
                               {"ceiling", 90, 10, 1.0, 1e-9}}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(c.name);
      const Character found = character_of(c.name, c.name, c.duration_s, seed);
      EXPECT_NEAR(found.tags_per_frame, c.tags_per_frame, c.tolerance);
      EXPECT_LT(found.empty_share, c.empty_below);
    }
  }
}

TEST(Room, SparseIsLikeItsClassOfData) {
  double empty = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Character c = character_of("sparse", "sparse", 60, seed);
    empty += c.empty_share / 5;
    EXPECT_LT(c.longest_gap_s, 3.0);
    EXPECT_LT(c.tags_per_frame, 1.0);
  }
  EXPECT_NEAR(empty, 0.21, 0.06);
}

}  // namespace
}  // namespace fiducap::simulation
