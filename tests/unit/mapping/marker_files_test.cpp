// apriltag_ros, RCARS, ArUco and the writer of WPILib's layouts: their corners and refusals.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "mapping/formats/map_format.hpp"
#include "support/replaced.hpp"
#include "support/results.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using testing::Contains;
using testing::HasSubstr;

constexpr double kRounding_m = 1e-9;

// --- apriltag_ros ---

constexpr const char* kBundle = R"(standalone_tags:
  [
    {id: 5, size: 0.1},
    {id: 2, size: 0.2, name: door}
  ]
tag_bundles:
  [
    {
      name: 'box',
      layout:
        [
          {id: 1, size: 0.2},
          {id: 2, size: 0.2, x: 1, y: 2.5, z: -0.25, qw: 0.7071067811865476, qz: 0.7071067811865476}
        ]
    }
  ]
)";

Expected<ImportedMap> read_bundle(const std::string& text) {
  return map_from_bundle_yaml(text, {}, "tags.yaml");
}

TEST(MapBundles, UsesTheIdentityByDefault) {
  const auto box = value_of(read_bundle(kBundle));
  ASSERT_EQ(box.map.tags.size(), 2u);
  EXPECT_LT(corner_off_m(box.map.find(1)->tag, 0, {-0.1, -0.1, 0}), kRounding_m);
  EXPECT_LT(corner_off_m(box.map.find(2)->tag, 0, {1.1, 2.4, -0.25}), kRounding_m);
  EXPECT_THAT(box.remarks, Contains("standalone tag 5 left out: no place is given"));
}

TEST(MapBundles, MayBeBelowTheNameOfANode) {
  std::string indented = std::string("    ") + kBundle;
  for (std::size_t at = 0; (at = indented.find('\n', at) + 1) < indented.size() && at > 0;)
    indented.insert(at, "    ");
  for (const std::string above : {"detector:\n", "/**:\n  ros__parameters:\n"}) {
    const std::string text = above + indented;
    EXPECT_EQ(value_of(map_format_of("tags.yaml", text)), MapFormat::kBundles) << text;
    EXPECT_EQ(value_of(read_bundle(text)).map.tags.size(), 2u);
  }
}

TEST(MapBundles, NamesMistakes) {
  const auto refused = [](const char* from, const char* to) {
    return error_of(read_bundle(replaced(kBundle, from, to)));
  };
  EXPECT_EQ(refused("qw: 0.7071067811865476", "qw: 0.5"),
            "tags.yaml:13: tag_bundles[0].layout[1]: quaternion has length 0.866025: must be 1");
  EXPECT_EQ(
      refused("{id: 1, size: 0.2}", "{id: 1, size: 200}"),
      "tags.yaml:12: tag_bundles[0].layout[0]: edge is 200 m: must be at most 10; sizes are in "
      "metres, 160 mm is 0.16");
  EXPECT_EQ(refused("{id: 1, size: 0.2}", "{id: 2, size: 0.2}"),
            "tags.yaml:13: tag_bundles[0].layout[1]: tag id 2 is there twice, first at "
            "tag_bundles[0].layout[0] in line 12");
  EXPECT_EQ(
      refused("{id: 2, size: 0.2, name", "{id: 2, size: 0.3, name"),
      "tags.yaml:13: tag_bundles[0].layout[1].size: is 0.2, but the standalone tag of this id "
      "has 0.3");
  EXPECT_EQ(refused("{id: 5, size: 0.1}", "{id: 2, size: 0.1}"),
            "tags.yaml:4: standalone_tags[1]: tag id 2 is there twice among the standalone tags");
  EXPECT_EQ(refused("y: 2.5", "Y: 2.5"), "tags.yaml:13: tag_bundles[0].layout[1].Y: unknown key");
  EXPECT_EQ(refused("\n    }\n", "\n    }, {name: bag, layout: [{id: 9, size: 0.1}]}\n"),
            "tags.yaml:15: tag_bundles[1]: bundle 'bag' has an origin of its own, whose "
            "place in bundle 'box' is not in the file; keep one bundle in the file");
}

// PyYAML, which ROS uses, reads 1 as a whole number and 1e-07 as a string.
TEST(MapBundles, WritesEveryNumberWithAPoint) {
  TagMap map;
  map.tags.resize(1);
  map.tags[0].tag.tag_id = 4;
  map.tags[0].tag.edge_m = 1;
  map.tags[0].tag.X_WT.p = {-2, 1e-7, 2.5e-9};
  EXPECT_THAT(map_to_bundle_yaml(map).text,
              HasSubstr("{id: 4, size: 1.0, x: -2.0, y: 1.0e-07, z: 2.5e-09, qw: 1.0,"));
}

// --- RCARS ---

constexpr const char* kWorkspace = R"(calibratedTags : [0, 12]
referenceTagId : 12
T_workspace_refTag :
  position: {x: 0.0, y: 0.0, z: 1.5}
  orientation: {w: 1.0, x: 0.0, y: 0.0, z: 0.0}
tags:
  tag0:
    type : static
    pose:
      position: {x: 1, y: 2, z: 3}
      orientation: {w: 0.7071067811865476, x: 0.7071067811865476, y: 0, z: 0}
  tag12:
    type : static
    pose:
      position: {x: 0, y: 0, z: 0.5}
      orientation: {w: 1, x: 0, y: 0, z: 0}
  tag3: {type: static}
)";

Expected<ImportedMap> read_workspace(const std::string& text) {
  return map_from_rcars_yaml(text, {.edge_m = 0.2}, "ws.yaml");
}

// qTI turns inertial coordinates into those of the tag. With a quarter about x the tag's up is the
// inertial z: a tag on a wall.
TEST(MapRcars, ReadsPassiveQuaternions) {
  const auto room = value_of(read_workspace(kWorkspace));
  EXPECT_LT(corner_off_m(room.map.find(0)->tag, 0, {0.9, 2, 2.9}), kRounding_m);
  EXPECT_LT(corner_off_m(room.map.find(0)->tag, 3, {0.9, 2, 3.1}), kRounding_m);
  EXPECT_THAT(room.remarks, Contains("the file has no sizes: all tags are 0.2 m"));
  EXPECT_THAT(room.remarks, Contains(HasSubstr("calibratedTags does not name, such as tag3")));
}

TEST(MapRcars, KeepsTheReferenceTagInARoundTrip) {
  const auto room = value_of(read_workspace(kWorkspace));
  EXPECT_EQ(room.map.reference_tag, 12);
  EXPECT_LT((room.map.X_RW.p - Vector3d(0, 0, 1)).norm(), kRounding_m);
  const auto exported = map_to_rcars_yaml(room.map);
  EXPECT_THAT(exported.remarks, Contains(HasSubstr("all tags are 0.2 m")));
  const auto again = value_of(read_workspace(exported.text));
  EXPECT_EQ(again.map.reference_tag, 12);
  EXPECT_LT((again.map.X_RW.p - room.map.X_RW.p).norm(), kRounding_m);
}

TEST(MapRcars, NamesMistakes) {
  const auto refused = [](const char* from, const char* to) {
    return error_of(read_workspace(replaced(kWorkspace, from, to)));
  };
  EXPECT_EQ(error_of(map_from_rcars_yaml(kWorkspace, {}, "ws.yaml")),
            "ws.yaml: RCARS workspaces do not contain the size of the tags; add --tag-size METRES");
  // As in the example of RCARS.
  EXPECT_EQ(refused("orientation: {w: 0.7071067811865476", "orientation: {w: 1"),
            "ws.yaml:8: tags.tag0: quaternion has length 1.22474: must be 1");
  EXPECT_EQ(refused("[0, 12]", "[0, 12, 0]"),
            "ws.yaml:1: calibratedTags[2]: tag id 0 is there twice, first at calibratedTags[0] in "
            "line 1");
  EXPECT_EQ(refused("[0, 12]", "[0, 12, 4]"), "ws.yaml:1: calibratedTags[2]: tags.tag4 is missing");
  EXPECT_EQ(refused("type : static", "type : dynamic"),
            "ws.yaml:8: tags.tag0.type: is 'dynamic': must be static");
  EXPECT_EQ(refused("referenceTagId : 12", "referenceTagId : 7"),
            "ws.yaml:2: referenceTagId: tag 7 is no calibrated tag");
  EXPECT_EQ(refused("tag3:", "tag0:"), "ws.yaml:17: tags.tag0: is there twice, first in line 7");
  EXPECT_EQ(refused("position: {x: 1, y: 2, z: 3}", "position: {x: 1, y: 2, z: 3, w: 0}"),
            "ws.yaml:10: tags.tag0.pose.position.w: unknown key");
}

TEST(MapRcars, NamesIdsBeyondOneByte) {
  EXPECT_THAT(map_to_rcars_yaml(random_map(1, 100)).remarks,  // ids up to 297
              Contains(HasSubstr("RCARS cannot see tags 258, 261")));
}

// --- ArUco ---

// As OpenCV 3 writes it, no blank after `id:` and `corners:`. Marker 7 is flat, its up is y; marker
// 9 is on the wall x = 1 and faces +x.
constexpr const char* kMarkers = R"(%YAML:1.0
---
aruco_bc_dict: TAG36h11
aruco_bc_nmarkers: 2
aruco_bc_mInfoType: 1
aruco_bc_markers:
   - { id:7, corners:[ [ -1.0000000149011612e-01, 0.1, 0. ], [ 0.1, 0.1, 0. ],
       [ 0.1, -0.1, 0. ], [ -0.1, -0.1, 0. ] ] }
   - { id:9, corners:[ [ 1., 0., 1.2 ], [ 1., 0.2, 1.2 ], [ 1., 0.2, 1. ],
       [ 1., 0., 1. ] ] }
)";

Expected<ImportedMap> read_markers(const std::string& text, const MapImportOptions& options = {}) {
  return map_from_aruco_yaml(text, options, "map.yml");
}

TEST(MapAruco, FollowsTheCornersOfTheFile) {
  constexpr double kFloat_m = 1e-8;  // the file's numbers are of single precision
  const auto map = value_of(read_markers(kMarkers));
  const KnownTag& flat = map.map.find(7)->tag;
  EXPECT_NEAR(flat.edge_m, 0.2, kFloat_m);
  EXPECT_LT(corner_off_m(flat, 3, {-0.1, 0.1, 0}), kFloat_m);
  EXPECT_LT(corner_off_m(flat, 1, {0.1, -0.1, 0}), kFloat_m);
  const KnownTag& wall = map.map.find(9)->tag;
  EXPECT_LT(corner_off_m(wall, 3, {1, 0, 1.2}), kFloat_m);
  EXPECT_LT((wall.X_WT.q * Vector3d::UnitZ() - Vector3d::UnitX()).norm(), kFloat_m);
  EXPECT_TRUE(map.remarks.empty());
}

TEST(MapAruco, TurnsOpenCvDictionariesByHalfATurn) {
  const auto map = value_of(read_markers(replaced(kMarkers, "TAG36h11", "DICT_APRILTAG_36h11")));
  EXPECT_EQ(map.map.family, "tag36h11");
  EXPECT_LT(corner_off_m(map.map.find(7)->tag, 1, {-0.1, 0.1, 0}), 1e-8);
  EXPECT_THAT(map.remarks, Contains(HasSubstr("turned back")));
}

TEST(MapAruco, RefusesAnUnknownDictionaryUnlessAFamilyIsGiven) {
  const std::string unknown = replaced(kMarkers, "TAG36h11", "ARUCO_MIP_36h12");
  EXPECT_THAT(error_of(read_markers(unknown)),
              AllOf(HasSubstr("ARUCO_MIP_36h12, which is not supported"), HasSubstr("--family")));
  const auto given = value_of(read_map(MapFormat::kAruco, unknown, {.family = "Tag25h9"}, ""));
  EXPECT_EQ(given.map.family, "tag25h9");
  EXPECT_THAT(given.remarks, ElementsAre(HasSubstr("tag25h9 is taken as given")));
}

TEST(MapAruco, ScalesPixelsByTheGivenSize) {
  constexpr const char* kPixels = R"(%YAML:1.0
aruco_bc_nmarkers: 2
aruco_bc_mInfoType: 0
aruco_bc_markers:
   - { id:1, corners:[ [ 0, 800, 0 ], [ 800, 800, 0 ], [ 800, 0, 0 ], [ 0, 0, 0 ] ] }
   - { id:2, corners:[ [ 1000, 800, 0 ], [ 1800, 800, 0 ], [ 1800, 0, 0 ], [ 1000, 0, 0 ] ] }
)";
  EXPECT_EQ(error_of(read_markers(kPixels)),
            "map.yml:3: aruco_bc_mInfoType: is 0: the corners are in pixels, so their size "
            "is unknown; add --tag-size METRES");
  const auto map = value_of(read_markers(kPixels, {.edge_m = 0.16}));
  EXPECT_LT((map.map.find(2)->tag.X_WT.p - Vector3d(0.28, 0.08, 0)).norm(), kRounding_m);
  EXPECT_EQ(map.map.find(2)->tag.edge_m, 0.16);
  EXPECT_THAT(map.remarks, Contains("the file is in pixels: 800 of them are taken as 0.16 m"));
  EXPECT_THAT(
      error_of(read_markers(
          replaced(kPixels, "[ 1000, 800, 0 ], [ 1800, 800, 0 ], [ 1800, 0, 0 ], [ 1000, 0, 0 ]",
                   "[ 1000, 400, 0 ], [ 1400, 400, 0 ], [ 1400, 0, 0 ], [ 1000, 0, 0 ]"),
          {.edge_m = 0.16})),
      HasSubstr("marker 2 is 400 pixels large, marker 1 800: one --tag-size cannot be right"));
}

TEST(MapAruco, NamesMistakes) {
  const auto refused = [](const char* from, const char* to) {
    return error_of(read_markers(replaced(kMarkers, from, to)));
  };
  EXPECT_EQ(refused("nmarkers: 2", "nmarkers: 3"),
            "map.yml:4: aruco_bc_nmarkers: is 3, but aruco_bc_markers has 2 entries");
  EXPECT_EQ(refused("mInfoType: 1", "mInfoType: -1"),
            "map.yml:5: aruco_bc_mInfoType: is -1: must be 1 (metres) or 0 (pixels)");
  EXPECT_EQ(refused("id:9", "id:7"),
            "map.yml:9: aruco_bc_markers[1]: tag id 7 is there twice, first at aruco_bc_markers[0] "
            "in line 7");
  EXPECT_EQ(refused(", [ 0.1, 0.1, 0. ]", ""),
            "map.yml:7: aruco_bc_markers[0].corners: has 3 corners: must be 4");
  EXPECT_EQ(refused("[ 0.1, 0.1, 0. ]", "[ 0.1, 0.1 ]"),
            "map.yml:7: aruco_bc_markers[0].corners[1]: has 2 numbers: must be x, y and z");
  EXPECT_THAT(refused("[ 1., 0., 1.2 ]", "[ 1., 0.02, 1.2 ]"),
              HasSubstr("map.yml:9: aruco_bc_markers[1].corners: a corner is "));
  EXPECT_THAT(refused("TAG36h11", "TAG36h11\nother: 1"), HasSubstr("other: unknown key"));
}

// --- WPILib ---

TEST(MapWpilibWriter, WritesWhatWpilibReads) {
  TagMap map;
  map.tags.resize(1);
  map.tags[0].tag.tag_id = 2;
  map.tags[0].tag.edge_m = 0.1651;
  // On the wall x = 0, facing into the field: WPILib's identity.
  map.tags[0].tag.X_WT = {{0.5, 0.5, 0.5, 0.5}, {0, 5, 1.5}};
  const auto exported = map_to_wpilib_json(map, FieldSize{16.5, 8.2});
  const auto layout = nlohmann::json::parse(exported.text);
  EXPECT_EQ(layout["field"]["length"], 16.5);
  EXPECT_EQ(layout["field"]["width"], 8.2);
  const auto& tag = layout["tags"][0];
  EXPECT_EQ(tag["ID"], 2);
  EXPECT_EQ(tag["pose"]["translation"]["y"], 5);
  EXPECT_NEAR(tag["pose"]["rotation"]["quaternion"]["W"].get<double>(), 1, 1e-15);
  EXPECT_THAT(exported.remarks,
              testing::ElementsAre("sizes are not part of this format: all tags are 0.1651 m"));
}

TEST(MapWpilibWriter, SizesTheFieldByTheTags) {
  const auto map = random_map(3);
  const auto exported = map_to_wpilib_json(map, std::nullopt);
  double reach_m = 0;
  for (const MapTag& entry : map.tags) reach_m = std::max(reach_m, entry.tag.X_WT.p.x());
  EXPECT_EQ(nlohmann::json::parse(exported.text)["field"]["length"], reach_m);
  EXPECT_THAT(exported.remarks, Contains(HasSubstr("add --field to set them")));
  EXPECT_THAT(exported.remarks, Contains(HasSubstr("negative x or y")));
  EXPECT_THAT(exported.remarks, Contains(HasSubstr("which has one for all")));
}

}  // namespace
}  // namespace fiducap
