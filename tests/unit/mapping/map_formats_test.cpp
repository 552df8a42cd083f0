#include "mapping/formats/map_format.hpp"

#include <gmock/gmock.h>

#include "base/text.hpp"
#include "base/whole_file.hpp"
#include "mapping/formats/map_exchange.hpp"
#include "support/replaced.hpp"
#include "support/results.hpp"
#include "support/shared_data.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

// Sorted insertion of single tags would take minutes and exceed the time limit.
TEST(MapCsv, SortsManyTagsQuickly) {
  constexpr int kTags = 150'000;
  std::string text = "id,size,px,py,pz,qw,qx,qy,qz\n";
  for (int id = kTags - 1; id >= 0; --id) text += std::to_string(id) + ",0.16,1,2,3,1,0,0,0\n";
  const auto map = value_of(map_from_csv(text, "down.csv"));
  ASSERT_EQ(map.tags.size(), std::size_t{kTags});
  EXPECT_EQ(fault_in(map), std::nullopt);
}

TEST(MapCsv, NamesADuplicateTagWithItsLine) {
  EXPECT_EQ(error_of(map_from_csv(
                "id,size,px,py,pz,qw,qx,qy,qz\n9,0.16,0,0,0,1,0,0,0\n3,0.16,0,0,0,1,0,0,0\n"
                "9,0.16,0,0,0,1,0,0,0\n",
                "twice.csv")),
            "twice.csv:4: tag id 9 is there twice, first at twice.csv:2");
}

// --- YAML ---

TEST(MapYaml, RoundTripKeepsEveryBit) {
  auto map = make_map({0, 5, 9});
  map.reference_tag = 5;
  map.version = 12;
  map.parent = 11;
  map.comment = "hall \"B\" \\ moved: #3\n\ttwice \x7f ü";
  map.tags[1].state = TagState::kQuarantined;
  map.tags[2].component = 2;
  map.hash = content_hash(map);
  const auto back = value_of(map_from_yaml(map_to_yaml(map), "hall.yaml"));
  EXPECT_EQ(content_hash(back), map.hash);
  EXPECT_EQ(back.hash, map.hash);
  EXPECT_EQ(back.version, 12);
  EXPECT_EQ(back.parent, 11);
  EXPECT_EQ(back.comment, map.comment);
  EXPECT_EQ(back.created_utc_ns, map.created_utc_ns);
}

TEST(MapYaml, RoundTripMovesCornersByLessThanAMicrometre) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const auto map = random_map(seed);
    constexpr double kRoundTrip_m = 1e-6;  // the promise; what is kept is exact
    EXPECT_LT(worst_corner_m(map, *map_from_yaml(map_to_yaml(map), "")), kRoundTrip_m);
    EXPECT_LT(worst_corner_m(map, *map_from_csv(map_to_csv(map), "")), kRoundTrip_m);
  }
}

TEST(MapYaml, ReadsAnEmptyMap) {
  const auto back = value_of(map_from_yaml(map_to_yaml(TagMap{}), ""));
  EXPECT_TRUE(back.tags.empty());
}

constexpr const char* kHandWritten = R"(format: fiducap-map
format_version: 1
family: tag36h11
tags:
  - {id: 4, edge_m: 0.2, position: [1, 2, 3], quaternion_wxyz: [0.7071, 0, 0, 0.7071],)"
                                     R"( state: surveyed}
  - {id: 2, edge_m: 0.1, position: [0, 0, 0], quaternion_wxyz: [1, 0, 0, 0], state: surveyed}
)";

TEST(MapYaml, ReadsAShortTextByHandByTheConventionOfCorners) {
  const auto map = value_of(map_from_yaml(kHandWritten, "hand.yaml"));
  ASSERT_EQ(map.tags.size(), 2u);
  EXPECT_EQ(map.tags[0].tag.tag_id, 2);
  EXPECT_NEAR(map.tags[1].tag.X_WT.q.norm(), 1.0, 1e-15);
  EXPECT_TRUE(map.tags[1].tag.covariance.isZero(0));
  EXPECT_EQ(map.version, 0);
  // Computed by hand: tag 4 is turned by a quarter about z.
  const auto& tag = map.find(4)->tag;
  EXPECT_LT(corner_off_m(tag, 0, {1.1, 1.9, 3}), 1e-9);
  EXPECT_LT(corner_off_m(tag, 1, {1.1, 2.1, 3}), 1e-9);
  EXPECT_LT(corner_off_m(tag, 3, {0.9, 1.9, 3}), 1e-9);
}

TEST(MapYaml, DropsTheHashOfAnEditedText) {
  auto map = make_map({1});
  map.hash = content_hash(map);
  map.version = 3;
  const auto edited =
      value_of(map_from_yaml(replaced(map_to_yaml(map), "sightings: 101", "sightings: 102"), ""));
  EXPECT_EQ(edited.hash, "");
  EXPECT_EQ(edited.version, 3);
}

struct YamlMistake {
  const char* from;
  const char* to;
  const char* place;
  const char* fault;
};
const YamlMistake kYamlMistakes[] = {
    {"fiducap-map", "tagslam", "hand.yaml:1", "format = 'tagslam': must be fiducap-map"},
    {"format_version: 1", "format_version: 2", "hand.yaml:2", "this Fiducap reads 1"},
    {"family: tag36h11\n", "", "hand.yaml:1", "family: is missing"},
    {"family: tag36h11", "famly: tag36h11", "hand.yaml:3", "famly: unknown key"},
    {"family: tag36h11", "format_version: 1", "hand.yaml:3", "format_version: is there twice"},
    {"edge_m: 0.2", "edge_m: -1", "hand.yaml:5", "tags[0]: edge_m = -1: must be finite and > 0"},
    {"edge_m: 0.2", "edge_m: wide", "hand.yaml:5",
     "tags[0].edge_m = 'wide': must be a finite number"},
    {"edge_m: 0.1", "edge_m: .nan", "hand.yaml:6", "tags[1].edge_m = '.nan'"},
    {"edge_m: 0.1", "edge: 0.1", "hand.yaml:6", "tags[1].edge: unknown key"},
    {"id: 2", "id: 2.5", "hand.yaml:6", "tags[1].id = '2.5': must be a whole number"},
    {"id: 2", "id: 99999999999999", "hand.yaml:6", "tags[1].id"},
    {"id: 2", "id: 4", "hand.yaml:6", "tag id 4 is there twice, first at tags[0] in line 5"},
    {"position: [0, 0, 0]", "position: [0, 0]", "hand.yaml:6", "must be a list of 3 numbers"},
    {"position: [0, 0, 0]", "position: [0, [], 0]", "hand.yaml:6", "tags[1].position[1]"},
    {"quaternion_wxyz: [1, 0, 0, 0]", "quaternion_wxyz: [1, 1, 0, 0]", "hand.yaml:6",
     "quaternion has length 1.414"},
    {"state: surveyed}\n  - {id: 2", "state: good}\n  - {id: 2", "hand.yaml:5",
     "tags[0].state = 'good'"},
    {"- {id: 2", "- {id: [2", "hand.yaml:6", "is not YAML"},
    {"tags:", "tags: {}\ncomment:", "hand.yaml:6", "comment: must be a text"},
    {"tags:", "comment: x\nreference_tag:", "hand.yaml:6",
     "reference_tag: must be a whole number"}};

TEST(MapYaml, NamesMistakesWithLineAndField) {
  for (const YamlMistake& one : kYamlMistakes) {
    SCOPED_TRACE(one.to);
    const auto map = map_from_yaml(replaced(kHandWritten, one.from, one.to), "hand.yaml");
    ASSERT_FALSE(map);
    EXPECT_EQ(map.error().code, ErrorCode::kInvalid);
    EXPECT_EQ(map.error().context, one.place);
    EXPECT_THAT(map.error().what, HasSubstr(one.fault));
  }
}

TEST(MapYaml, RefusesOtherTexts) {
  for (const std::string text :
       {"", "just words", "- 1\n- 2", "\t\x01\x02", "{{{{{{", "&a [*a]", "tags: !!binary x"}) {
    const auto map = map_from_yaml(text, "x.yaml");
    ASSERT_FALSE(map) << text;
    EXPECT_FALSE(map.error().what.empty());
  }
  EXPECT_FALSE(map_from_yaml(std::string(100'000, '['), "deep.yaml"));
}

TEST(MapYaml, DoesNotMoveTagsOfATruncatedText) {
  const auto map = make_map({1, 2});
  const auto text = map_to_yaml(map);
  int shorter = 0;
  for (std::size_t left = 0; left < text.size(); left += 3) {
    const auto cut = map_from_yaml(text.substr(0, left), "cut.yaml");
    if (!cut) continue;
    ++shorter;
    auto expected = map;
    expected.tags.resize(cut->tags.size());
    EXPECT_EQ(worst_corner_m(*cut, expected), 0) << left;
  }
  EXPECT_GT(shorter, 0);
}

// --- CSV ---

TEST(MapCsv, ReadsTheFormatOfRecordings) {
  const auto map = value_of(map_from_csv(
      "id,size,px,py,pz,qw,qx,qy,qz\r\n7,0.16,1,2,3,1,0,0,0\r\n\n3,0.2,0,0,0,0,1,0,0\n",
      "tags.csv"));
  ASSERT_EQ(map.tags.size(), 2u);
  EXPECT_EQ(map.tags[0].tag.tag_id, 3);
  EXPECT_EQ(map.tags[0].tag.edge_m, 0.2);
  EXPECT_EQ(map.tags[0].tag.X_WT.q.x(), 1);
  EXPECT_EQ(map.tags[1].tag.X_WT.p, Vector3d(1, 2, 3));
  EXPECT_EQ(map.tags[0].state, TagState::kSurveyed);
}

TEST(MapCsv, NamesLineAndColumn) {
  const std::string header = "id,size,px,py,pz,qw,qx,qy,qz\n";
  const auto refused = [](const std::string& text) {
    return error_of(map_from_csv(text, "tags.csv"));
  };
  EXPECT_EQ(refused(""), "tags.csv:1: expected the header 'id,size,px,py,pz,qw,qx,qy,qz'");
  EXPECT_EQ(refused("id,size\n"), "tags.csv:1: expected the header 'id,size,px,py,pz,qw,qx,qy,qz'");
  EXPECT_EQ(refused(header + "1,0.1,0,0,0,1,0,0,0\n2,0.1,x,0,0,1,0,0,0\n"),
            "tags.csv:3: px = 'x': must be a finite number");
  EXPECT_EQ(refused(header + "1e20,0.1,0,0,0,1,0,0,0\n"),
            "tags.csv:2: id = '1e20': must be a whole number");
  EXPECT_EQ(refused(header + "1,0.1,0,0,0,1,0\n"),
            "tags.csv:2: expected 9 columns (id,size,px,py,pz,qw,qx,qy,qz), found 7");
  EXPECT_EQ(refused(header + "1,0.1,0,0,0,1,0,0,0,5\n"), "tags.csv:2: more than 9 columns");
  EXPECT_EQ(refused(header + "1,0.1,0,0,0,1,0,0,nan\n"),
            "tags.csv:2: qz = 'nan': must be a finite number");
  EXPECT_EQ(refused(header + "1,0,0,0,0,1,0,0,0\n"),
            "tags.csv:2: edge_m = 0: must be finite and > 0");
}

// --- WPILib ---

std::string field_tag(int id, const std::string& xyz, const std::string& wxyz) {
  return R"({"ID": )" + std::to_string(id) + R"(, "pose": {"translation": )" + xyz +
         R"(, "rotation": {"quaternion": )" + wxyz + "}}}";
}

const std::string kField =
    R"({"tags": [)" +
    field_tag(2, R"({"x": 0, "y": 5, "z": 1.5})", R"({"W": 1, "X": 0, "Y": 0, "Z": 0})") + "," +
    field_tag(1, R"({"x": 16, "y": 5, "z": 1.5})", R"({"W": 0, "X": 0, "Y": 0, "Z": 1})") +
    R"(], "field": {"length": 16.5, "width": 8.2}})";

// Tag 2 is on the wall x = 0 and faces +x, into the field. For a viewer in the field +y is to the
// right and z up.
TEST(MapWpilib, FollowsTheConventionOfWpilib) {
  constexpr double kEdge_m = 0.2;
  constexpr double kCornerRounding_m = 1e-12;
  const auto map = value_of(map_from_wpilib_json(kField, kEdge_m, "field.json"));
  const KnownTag& tag = map.find(2)->tag;
  EXPECT_LT(corner_off_m(tag, 0, {0, 4.9, 1.4}), kCornerRounding_m);
  EXPECT_LT(corner_off_m(tag, 1, {0, 5.1, 1.4}), kCornerRounding_m);
  EXPECT_LT(corner_off_m(tag, 2, {0, 5.1, 1.6}), kCornerRounding_m);
  EXPECT_LT(corner_off_m(tag, 3, {0, 4.9, 1.6}), kCornerRounding_m);
  EXPECT_LT((tag.X_WT.q * Vector3d::UnitZ() - Vector3d::UnitX()).norm(),
            kCornerRounding_m);  // the face
  // The opposite wall: the viewer looks along +x and has -y on the right hand.
  EXPECT_LT(corner_off_m(map.find(1)->tag, 1, {16, 4.9, 1.4}), kCornerRounding_m);
  EXPECT_EQ(map.find(1)->tag.edge_m, kEdge_m);
  EXPECT_EQ(map.find(1)->state, TagState::kSurveyed);
}

TEST(MapWpilib, NamesWhatIsMissing) {
  const auto refused = [](const std::string& text) {
    return error_of(map_from_wpilib_json(text, 0.165, "field.json"));
  };
  EXPECT_EQ(refused("{}"), "field.json: 'tags' is missing");
  EXPECT_EQ(refused("[]"), "field.json: expected an object with 'tags'");
  EXPECT_EQ(refused(R"({"tags": 3})"), "field.json: 'tags' must be a list");
  EXPECT_EQ(refused(replaced(kField, R"("W": 0)", R"("w": 0)")),
            "field.json /tags/1/pose/rotation/quaternion: 'W' is missing");
  EXPECT_EQ(refused(replaced(kField, R"("y": 5)", R"("y": "5")")),
            "field.json /tags/0/pose/translation: 'y' must be a number");
  EXPECT_EQ(refused(replaced(kField, R"("ID": 1)", R"("ID": 4294967298)")),
            "field.json /tags/1: 'ID' = 4294967298: must be a whole number from 0 to 1000000");
  EXPECT_EQ(refused(replaced(kField, R"("ID": 1)", R"("ID": 2)")),
            "field.json /tags/1: tag id 2 is there twice, first at field.json /tags/0");
  EXPECT_THAT(refused(replaced(kField, R"("W": 1)", R"("W": 2)")),
              HasSubstr("quaternion has length 2"));
  EXPECT_THAT(refused(kField.substr(0, 50)), HasSubstr("is not JSON"));
  EXPECT_THAT(refused(replaced(kField, "16.5", "1e999")), HasSubstr("is not JSON"));
}

TEST(MapWpilib, ReadsTheFieldOf2024) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  const auto file = *data / "detector" / "wpical" / "2024-crescendo.json";
  const auto map =
      value_of(map_from_wpilib_json(value_of(read_whole_file(file.string())), 0.1651, "field"));
  ASSERT_EQ(map.tags.size(), 16u);
  constexpr double kUpright = 1e-9;
  for (const MapTag& entry : map.tags)
    EXPECT_NEAR((entry.tag.X_WT.q * Vector3d::UnitY()).z(), 1.0, kUpright) << entry.tag.tag_id;
  // Speaker tags: 4 looks along -x from the red wall, 7 along +x from the blue one.
  EXPECT_NEAR((map.find(4)->tag.X_WT.q * Vector3d::UnitZ()).x(), -1.0, kUpright);
  EXPECT_NEAR((map.find(7)->tag.X_WT.q * Vector3d::UnitZ()).x(), 1.0, kUpright);
}

TEST(TextNumber, ReadsWholeNumbersOnly) {
  EXPECT_EQ(number_from<double>("+1.5e3"), 1500.0);
  for (const char* bad : {"1.5 ", "", "+", "inf", "1,5"})
    EXPECT_EQ(number_from<double>(bad), std::nullopt) << bad;
  EXPECT_EQ(number_from<int>("1.0"), std::nullopt);
  EXPECT_EQ(number_from<double>(shortest(0.1)), 0.1);
}

}  // namespace
}  // namespace fiducap
