#include <gmock/gmock.h>

#include "mapping/formats/map_format.hpp"
#include "support/replaced.hpp"
#include "support/results.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr double kPlaceRounding_m = 1e-9;

// A wall 2 m away in x, turned by a quarter about z, with one tag in its middle and one half a
// metre up; a robot that carries a tag.
constexpr const char* kRoom = R"(tagslam_parameters: {optimizer_mode: fast}
body_defaults: {position_noise: 0.05, rotation_noise: 0.01}
default_body: wall
bodies:
  - wall:
      type: simple
      is_static: true
      default_tag_size: 0.2
      pose:
        position: {x: 2, y: 0, z: 1}
        rotation: {x: 0, y: 0, z: 1.5707963267948966}
        position_noise: {x: 0.001, y: 0.002, z: 0.003}
        rotation_noise: {x: 0, y: 0, z: 0.01}
      tags:
        - id: 7
          pose:
            position: {x: 0, y: 0, z: 0}
            rotation: {x: 0, y: 0, z: 0}
        - id: 3
          size: 0.1
          pose:
            position: {x: 1, y: 0, z: 0.5}
            rotation: {x: 1.5707963267948966, y: 0, z: 0}
            position_noise: {x: 0.001, y: 0.001, z: 0.004}
            rotation_noise: {x: 0.1, y: 0.2, z: 0.3}
        - id: 9
          size: 0.1
  - robot:
      type: simple
      is_static: false
      fake_odom_rotation_noise: 1.0
      tags:
        - {id: 20, size: 0.05, pose: {position: {x: 0, y: 0, z: 0}, rotation: {x: 0, y: 0, z: 0}}}
distance_measurements: []
)";

Expected<ImportedMap> read(const std::string& text) {
  return map_from_tagslam_yaml(text, {}, "tagslam.yaml");
}

TEST(MapTagslam, ComposesPosesOfBodyAndTag) {
  const auto room = value_of(read(kRoom));
  ASSERT_EQ(room.map.tags.size(), 2u);
  const KnownTag& flat = room.map.find(7)->tag;
  EXPECT_EQ(flat.edge_m, 0.2);  // the body's default
  EXPECT_LT(corner_off_m(flat, 0, {2.1, -0.1, 1}), kPlaceRounding_m);
  EXPECT_LT(corner_off_m(flat, 1, {2.1, 0.1, 1}), kPlaceRounding_m);
  // Turned up about the wall's x, which is the world's y: its up is z, its face looks along +x.
  const KnownTag& upright = room.map.find(3)->tag;
  EXPECT_EQ(upright.edge_m, 0.1);
  EXPECT_LT((upright.X_WT.p - Vector3d(2, 1, 1.5)).norm(), kPlaceRounding_m);
  EXPECT_LT((upright.X_WT.q * Vector3d::UnitY() - Vector3d::UnitZ()).norm(), kPlaceRounding_m);
  EXPECT_LT((upright.X_WT.q * Vector3d::UnitZ() - Vector3d::UnitX()).norm(), kPlaceRounding_m);
}

TEST(MapTagslam, ConvertsNoiseToCovariance) {
  const auto room = value_of(read(kRoom));
  constexpr double kRounding = 1e-12;
  const Matrix6d& P = room.map.find(3)->tag.covariance;
  // Position, along the world's x: the wall's y (2 mm), the tag's z (4 mm), and 1 m away the wall's
  // turn by 10 mrad.
  EXPECT_NEAR(P(0, 0), 0.002 * 0.002 + 0.004 * 0.004 + 0.01 * 0.01, kRounding);
  // Along the world's y: the wall's x, the tag's x; along z: the wall's z, the tag's y.
  EXPECT_NEAR(P(1, 1), 0.001 * 0.001 + 0.001 * 0.001, kRounding);
  EXPECT_NEAR(P(2, 2), 0.003 * 0.003 + 0.001 * 0.001, kRounding);
  // Attitude: about the world's z the tag's y and the wall's z.
  EXPECT_NEAR(P(3, 3), 0.3 * 0.3, kRounding);
  EXPECT_NEAR(P(4, 4), 0.1 * 0.1, kRounding);
  EXPECT_NEAR(P(5, 5), 0.2 * 0.2 + 0.01 * 0.01, kRounding);
  // A turn of the wall about z takes the tag along -x.
  EXPECT_NEAR(P(0, 5), -0.01 * 0.01, kRounding);
}

TEST(MapTagslam, NamesTagsWithoutAPose) {
  const auto room = value_of(read(kRoom));
  EXPECT_THAT(room.remarks, Contains("tag 9 of bodies[0].wall left out: no pose is given"));
  EXPECT_THAT(room.remarks,
              Contains("tag 20 of bodies[1].robot left out: where the body is, is not known"));
  EXPECT_THAT(room.remarks, Contains("not read: distance_measurements"));
  EXPECT_THAT(room.remarks, Contains(HasSubstr("tag36h11 is assumed")));
}

TEST(MapTagslam, KeepsSigmasInARoundTrip) {
  auto room = value_of(read(kRoom));
  const auto again = value_of(read(map_to_tagslam_yaml(room.map).text));
  EXPECT_THAT(again.remarks, Not(Contains(HasSubstr("assumed"))));  // bits are written
  for (const MapTag& entry : again.map.tags) {
    const auto before = room.map.find(entry.tag.tag_id)->tag.covariance.diagonal().eval();
    const auto after = entry.tag.covariance.diagonal().eval();
    constexpr double kOfTheBody = 1e-10;  // the workspace is written with 1 µm and 1 µrad
    // Upright and flat tags: the axes are the world's, so nothing turns into another.
    EXPECT_LT((before - after).cwiseAbs().maxCoeff(), kOfTheBody) << entry.tag.tag_id;
  }
}

// As TagSLAM writes its result: eight decimals, moving bodies, a body without tags.
TEST(MapTagslam, ReadsPosesAsTagslamWritesThem) {
  const auto xyz = [](const char* indent, const char* name, const char* x, const char* y,
                      const char* z) {
    const std::string line = std::string("\n") + indent;
    return line + name + ":" + line + "  x: " + x + line + "  y: " + y + line + "  z: " + z;
  };
  const char* body = "       ";
  const char* tag_pose = "           ";
  const std::string poses =
      "bodies:\n - hall:\n     type: simple\n     is_static: true\n     default_tag_size: 0.15\n"
      "     pose:" +
      xyz(body, "position", "0.00000000", "0.00000000", "0.50000000") +
      xyz(body, "rotation", "0.00000000", "0.00000000", "-0.00000000") +
      xyz(body, "position_noise", "0.00010000", "0.00010000", "0.00010000") +
      xyz(body, "rotation_noise", "0.00000000", "0.00000000", "0.00000000") +
      "\n     tags:\n       - id: 12\n         size: 0.15\n         pose:" +
      xyz(tag_pose, "position", "1.00000000", "2.00000000", "0.25000000") +
      xyz(tag_pose, "rotation", "1.57079633", "0.00000000", "0.00000000") +
      xyz(tag_pose, "position_noise", "0.00200000", "0.00200000", "0.00200000") +
      xyz(tag_pose, "rotation_noise", "0.00100000", "0.00100000", "0.00100000") +
      "\n - robot:\n     type: simple\n     is_static: false\n     default_tag_size: 0\n     "
      "tags:\n";
  constexpr double kEightDecimals_m = 1e-8;
  const auto hall = value_of(read(poses));
  const KnownTag& tag = hall.map.find(12)->tag;
  EXPECT_EQ(tag.edge_m, 0.15);
  EXPECT_LT(corner_off_m(tag, 3, {0.925, 2, 0.825}), kEightDecimals_m);
  EXPECT_NEAR(tag.covariance(0, 0), 0.002 * 0.002 + 0.0001 * 0.0001, 1e-12);
  EXPECT_NEAR(tag.covariance(3, 3), 0.001 * 0.001, 1e-12);
}

// As TagSLAM's code makes them; a board has no ids of its own in the file.
TEST(MapTagslam, LaysOutBoards) {
  constexpr const char* kBoards = R"(bodies:
  - table:
      type: board
      is_static: true
      pose: {position: {x: 0, y: 0, z: 1}, rotation: {x: 0, y: 0, z: 0}}
      board: {tag_start_id: 10, tag_size: 0.1, tag_spacing: 0.5, tag_rows: 2, tag_columns: 3,
              tag_bits: 5, tag_rotation_noise: 0.001, tag_position_noise: 0.002,
              pose: {position: {x: 1, y: 0, z: 0}, rotation: {x: 0, y: 0, z: 0}}}
  - wall:
      type: staggered_board
      is_static: true
      pose: {position: {x: 0, y: 0, z: 2}, rotation: {x: 0, y: 0, z: 0}}
      staggered_board: {tag_start_id: 20, tag_size: 0.1, tag_spacing: 0, tag_rows: 2,
                        tag_columns: 3}
)";
  const auto boards = value_of(read(kBoards));
  EXPECT_EQ(boards.map.family, "tag25h9");
  ASSERT_EQ(boards.map.tags.size(), 9u);
  const auto off_m = [&](int id, const Vector3d& place) {
    return (boards.map.find(id)->tag.X_WT.p - place).norm();
  };
  EXPECT_LT(off_m(10, {-1, 0, 1}), kPlaceRounding_m);
  EXPECT_LT(off_m(12, {-0.7, 0, 1}), kPlaceRounding_m);
  EXPECT_LT(off_m(13, {-1, 0.15, 1}), kPlaceRounding_m);
  EXPECT_LT(off_m(21, {0.2, 0, 2}), kPlaceRounding_m);
  EXPECT_LT(off_m(22, {0.1, -0.1, 2}), kPlaceRounding_m);
  EXPECT_NEAR(boards.map.find(10)->tag.covariance(0, 0), 4e-6, 1e-12);
  EXPECT_THAT(boards.remarks, Contains(HasSubstr("that of the body on the board")));
}

struct TagslamMistake {
  const char* from;
  const char* to;
  const char* fault;
};
const TagslamMistake kTagslamMistakes[] = {
    {"{x: 1.5707963267948966, y: 0, z: 0}", "{x: 90, y: 0, z: 0}",
     "tagslam.yaml:23: bodies[0].wall.tags[1].pose.rotation: is 90 long: must be "
     "axis x angle in radians, at most 2 pi; are these degrees?"},
    {"size: 0.1\n          pose", "size: 160\n          pose",
     "tagslam.yaml:19: bodies[0].wall.tags[1]: edge is 160 m: must be at most 10; "
     "sizes are in metres, 160 mm is 0.16"},
    {"id: 3\n", "id: 7\n",
     "tagslam.yaml:19: bodies[0].wall.tags[1]: tag id 7 is there twice, first at "
     "bodies[0].wall.tags[0] in line 15"},
    {"      default_tag_size: 0.2\n", "",
     "tagslam.yaml:14: bodies[0].wall.tags[0]: size: is missing, and so is "
     "default_tag_size of the body"},
    {"position: {x: 1, y: 0, z: 0.5}", "position: {x: 1, y: 0}",
     "tagslam.yaml:22: bodies[0].wall.tags[1].pose.position.z: is missing"},
    {"position: {x: 1, y: 0, z: 0.5}", "position: {x: 1, y: 0, z: up}",
     "tagslam.yaml:22: bodies[0].wall.tags[1].pose.position.z = 'up': must be a "
     "finite number"},
    {"size: 0.1\n          pose", "sice: 0.1\n          pose",
     "tagslam.yaml:20: bodies[0].wall.tags[1].sice: unknown key"},
    {"size: 0.1\n          pose", "size: 0.1\n          bits: 7\n          pose",
     "tagslam.yaml:19: bodies[0].wall.tags[1]: bits = 7: must be 4, 5 or 6 (side "
     "of the code)"},
    {"is_static: true", "is_static: maybe",
     "tagslam.yaml:7: bodies[0].wall.is_static = 'maybe': must be true or false"},
    {"is_static: true", "is_static: false",
     "tagslam.yaml:6: bodies[0].wall: has a pose, but moves (is_static: false)"},
    {"type: simple", "type: cube",
     "tagslam.yaml:6: bodies[0].wall.type: is 'cube': must be simple, board or "
     "staggered_board"},
    {"z: 0.004}", "z: -0.004}",
     "tagslam.yaml:24: bodies[0].wall.tags[1].pose.position_noise: must be "
     "between 0 and 1000000"},
    {"  - wall:\n      type", "  - wall: here\n    other:\n      type",
     "tagslam.yaml:5: bodies[0].wall: must be a map: the keys of a body are one "
     "level deeper than its name"},
    {"bodies:", "body:", "tagslam.yaml:1: bodies: is missing"},
    {"default_body: wall", "body_defaults: wall",
     "tagslam.yaml:3: body_defaults: is there twice, first in line 2"}};

TEST(MapTagslam, NamesMistakesWithLineAndPath) {
  for (const TagslamMistake& one : kTagslamMistakes)
    EXPECT_EQ(error_of(read(replaced(kRoom, one.from, one.to))), one.fault) << one.to;
}

}  // namespace
}  // namespace fiducap
