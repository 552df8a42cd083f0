// Maps of all other programs: round trips, implausible units and conventions.
#include "mapping/formats/map_format.hpp"

#include <gmock/gmock.h>

#include "mapping/formats/map_exchange.hpp"
#include "support/results.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double kRoundTrip_m = 1e-6;  // the promise
constexpr double kEdge_m = 0.16;

class ForeignMaps : public testing::TestWithParam<MapFormat> {
 protected:
  /// Formats without sizes get tags of one.
  [[nodiscard]] static TagMap sized(TagMap map) {
    if (GetParam() == MapFormat::kRcars || GetParam() == MapFormat::kWpilib)
      for (MapTag& entry : map.tags) entry.tag.edge_m = kEdge_m;
    return map;
  }
  [[nodiscard]] static MapImportOptions options() { return {.edge_m = kEdge_m}; }
  [[nodiscard]] static Expected<ImportedMap> back(const TagMap& map) {
    return read_map(GetParam(), write_map(GetParam(), map).text, options(), "back");
  }
};

TEST_P(ForeignMaps, RoundTripMovesCornersByLessThanAMicrometre) {
  double worst_m = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const TagMap map = sized(random_map(seed));
    const auto again = value_of(back(map));
    worst_m = std::max(worst_m, worst_corner_m(map, again.map));
    EXPECT_EQ(fault_in(again.map), std::nullopt);
    EXPECT_EQ(again.map.family, "tag36h11");
    EXPECT_EQ(again.map.tags.front().state, TagState::kSurveyed);
  }
  RecordProperty("worst_corner_fm", std::to_string(worst_m * 1e15));
  EXPECT_LT(worst_m, kRoundTrip_m);
}

// Rotation vectors and quaternions are singular there.
TEST_P(ForeignMaps, RoundTripKeepsHalfTurns) {
  TagMap map;
  for (int id = 0; id < 6; ++id) {
    Eigen::Vector4d wxyz = Eigen::Vector4d::Zero();
    wxyz(1 + id % 3) = id < 3 ? 1 : -1;
    wxyz(0) = id < 3 ? 0 : 1e-9;
    const Eigen::Quaterniond q_WT(wxyz(0), wxyz(1), wxyz(2), wxyz(3));
    map.tags.push_back({.tag = {id, kEdge_m, {q_WT, {1.0 * id, 2, 3}}}});
  }
  const auto again = value_of(back(map));
  EXPECT_LT(worst_corner_m(map, again.map), kRoundTrip_m);
}

TEST_P(ForeignMaps, RecognisesItsOwnText) {
  const auto format =
      value_of(map_format_of("map.txt", write_map(GetParam(), make_map({1, 2})).text));
  EXPECT_EQ(format, GetParam());
}

TEST_P(ForeignMaps, OmitsAndNamesUnusableTags) {
  TagMap map = sized(make_map({1, 2, 3, 4}));
  map.tags[1].state = TagState::kQuarantined;
  map.tags[3].component = 2;
  const auto exported = write_map(GetParam(), map);
  EXPECT_THAT(exported.remarks, Contains(HasSubstr("tags 2 and 4 left out")));
  EXPECT_THAT(exported.remarks, Contains(HasSubstr("covariances")));
  const auto again = value_of(read_map(GetParam(), exported.text, options(), "back"));
  EXPECT_EQ(again.map.tags.size(), 2u);
}

TEST_P(ForeignMaps, RefusesAFileWithoutTags) {
  if (GetParam() == MapFormat::kWpilib || GetParam() == MapFormat::kLimelight)
    GTEST_SKIP() << "an empty field is one";
  EXPECT_THAT(error_of(back(TagMap{})), HasSubstr("no tag whose place and size are known"));
}

TEST_P(ForeignMaps, DoesNotMoveTagsOfATruncatedText) {
  const TagMap map = sized(make_map({1, 2}));
  const std::string text = write_map(GetParam(), map).text;
  for (std::size_t left = 0; left < text.size(); left += 3) {
    const auto cut = read_map(GetParam(), text.substr(0, left), options(), "cut");
    if (!cut) continue;
    for (const MapTag& entry : cut->map.tags) {
      TagMap one;
      one.tags = {entry};
      TagMap expected;
      expected.tags = {*map.find(entry.tag.tag_id)};
      // A number may have lost its last digits, nothing else.
      EXPECT_LT(worst_corner_m(one, expected), 1.0) << left;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, ForeignMaps,
                         testing::Values(MapFormat::kTagslam, MapFormat::kBundles,
                                         MapFormat::kRcars, MapFormat::kAruco, MapFormat::kWpilib,
                                         MapFormat::kLimelight),
                         [](const auto& info) { return std::string(name_of(info.param)); });

// --- doubts ---

TEST(ImpossiblePlaces, AreRefused) {
  for (const std::string tag : {"0.16,-1e308,0,1", "0.16,0,2e6,1", "160,0,0,1", "0.0001,0,0,1"})
    EXPECT_THAT(
        error_of(read_map(MapFormat::kCsv, "id,size,px,py,pz,qw,qx,qy,qz\n3," + tag + ",1,0,0,0\n",
                          {}, "tags.csv")),
        HasSubstr("tag 3: "))
        << tag;
}

TEST(CoveredTags, AreRefused) {
  const auto read_csv = [](double step_m) {
    std::string text = "id,size,px,py,pz,qw,qx,qy,qz\n";
    for (int id = 0; id < 8; ++id)
      text += std::to_string(id) + ",0.16," + std::to_string(step_m * id) + ",0,1,1,0,0,0\n";
    return read_map(MapFormat::kCsv, text, {}, "tags.csv");
  };
  EXPECT_THAT(error_of(read_csv(0)), HasSubstr("cover each other, near 0, 0, 1 m"));
  EXPECT_THAT(error_of(read_csv(0.1)), HasSubstr("cover each other"));
  EXPECT_TRUE(read_csv(0.2));
  EXPECT_TRUE(read_map(MapFormat::kCsv,
                       "id,size,px,py,pz,qw,qx,qy,qz\n1,0.5,0,0,1,1,0,0,0\n"
                       "2,0.1,0,0,1,1,0,0,0\n3,0.5,0,0,1,0,1,0,0\n4,0.1,0.3,0.3,1,1,0,0,0\n",
                       {}, "tags.csv"))
      << "a small tag in the middle of a large one, one on its back, one beside its corner";
  for (const std::string tag : {"0.16,0.17,0.02,0,0.92388,0,0,0.38268", "0.02,0.05,0,0,1,0,0,0",
                                "0.4,0.2,0.2,0.03,1,0,0,0"})
    EXPECT_THAT(
        error_of(read_map(MapFormat::kCsv,
                          "id,size,px,py,pz,qw,qx,qy,qz\n1,0.16,0,0,0,1,0,0,0\n2," + tag + "\n", {},
                          "tags.csv")),
        HasSubstr("tags 1 and 2 cover each other"))
        << tag;
}

TagMap two_tags(const Eigen::Quaterniond& q_WT, double z_m) {
  TagMap map;
  for (int id = 0; id < 2; ++id)
    map.tags.push_back({.tag = {id, kEdge_m, {q_WT, {1.0 * id, 0, z_m}}}});
  return map;
}

// A wall looking along -y with its tags upright: x stays, y goes up, z out of it.
const Eigen::Quaterniond kOnWall(std::sqrt(0.5), std::sqrt(0.5), 0, 0);
const Eigen::Quaterniond kHalfTurnAboutX(0, 1, 0, 0);

TEST(MapDoubts, AcceptUsualRoomsAndNameImplausiblePoses) {
  EXPECT_THAT(plausibility_remarks(two_tags(kOnWall, 1.5)), IsEmpty());
  EXPECT_THAT(plausibility_remarks(two_tags(Eigen::Quaterniond::Identity(), 0)), IsEmpty());
  EXPECT_THAT(plausibility_remarks(two_tags(kHalfTurnAboutX, 2.5)), IsEmpty());  // on the ceiling
  EXPECT_THAT(plausibility_remarks(TagMap{}), IsEmpty());
  TagMap far = two_tags(kOnWall, 1.5);
  far.tags[1].tag.X_WT.p.x() = 2500;
  const std::pair<TagMap, const char*> cases[] = {
      {two_tags(kOnWall, -1.5), "are below z = 0"},
      {two_tags(kOnWall * kHalfTurnAboutX, 1.5), "upside down"},  // the axes of libapriltag
      {two_tags(kHalfTurnAboutX, 0), "face down"},
      {far, "tag 1 is 2500 m from the origin"}};
  for (const auto& [map, text] : cases)
    EXPECT_THAT(plausibility_remarks(map), Contains(HasSubstr(text)));
}

TEST(MapDoubts, AbbreviateLongLists) {
  EXPECT_EQ(tags_text({3}), "tag 3");
  EXPECT_EQ(tags_text({3, 5, 7}), "tags 3, 5 and 7");
  EXPECT_THAT(tags_text({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}), HasSubstr("10 and 2 more"));
}

// --- which format ---

TEST(MapFormats, AreRecognisedByContentFirst) {
  const auto is = [](const std::string& file, const std::string& text) {
    const auto format = map_format_of(file, text);
    return format ? std::string(name_of(*format)) : format.error().text();
  };
  EXPECT_EQ(is("tagslam.yaml", "# a comment\ntagslam_parameters:\n  x: 1\nbodies:\n"), "tagslam");
  EXPECT_EQ(is("a.yaml", "\xef\xbb\xbftag_bundles :\n  []\n"), "apriltag_ros");
  EXPECT_EQ(is("a.yaml", "\n  \ncalibratedTags : [0]\r\n"), "rcars");
  EXPECT_EQ(is("map.yml", "%YAML:1.0\n---\naruco_bc_dict: X\naruco_bc_nmarkers: 2\n"), "aruco");
  EXPECT_EQ(is("a.yaml", " {\"tags\": []}"), "wpilib");
  EXPECT_EQ(is("a.json", "{\"format\": \"fiducap-map\"}"), "fiducap");
  EXPECT_EQ(is("a.yaml", "id,size,px,py,pz,qw,qx,qy,qz\n"), "csv");
  EXPECT_EQ(is("a.csv", "nothing"), "csv");
  EXPECT_EQ(is("a.json", "nothing"), "wpilib");
  EXPECT_THAT(is("a.yaml", "  bodies: 3\ntags: 4\n"),
              AllOf(HasSubstr("a.yaml: is a map of no known format, by its content"),
                    HasSubstr("name the format with --format: fiducap, csv, tagslam")));
  // Of a file that is written:
  EXPECT_EQ(*map_format_of("a.yml"), MapFormat::kFiducap);
  EXPECT_EQ(*map_format_of("a.csv"), MapFormat::kCsv);
  EXPECT_EQ(*map_format_of("a.json"), MapFormat::kWpilib);
  EXPECT_THAT(map_format_of("a.xyz").error().text(), HasSubstr("not '.xyz'"));
}

TEST(MapFormats, CheckTheGivenSize) {
  const std::string csv = "id,size,px,py,pz,qw,qx,qy,qz\n1,0.2,0,0,0,1,0,0,0\n";
  const auto wrong = read_map(MapFormat::kCsv, csv, {.edge_m = 160}, "a.csv");
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().text(),
            "a.csv: the given size: edge is 160 m: must be at most 10; sizes are in metres, 160 mm "
            "is 0.16");
  const auto right = value_of(read_map(MapFormat::kCsv, csv, {.edge_m = 0.16}, "a.csv"));
  EXPECT_EQ(right.map.tags[0].tag.edge_m, 0.2);
  EXPECT_THAT(right.remarks, Contains(HasSubstr("--tag-size is not used")));
}

TEST(MapFormats, NameTagsOfAFieldThatAreNeitherUprightNorFlat) {
  const auto remarks = [](double w, double x, double y, double z) {
    const auto number = [](const char* name, double value) {
      return "\"" + std::string(name) + "\": " + std::to_string(value);
    };
    return value_of(read_map(MapFormat::kWpilib,
                             R"({"tags": [{"ID": 11, "pose": {"translation": {"x": 1, "y": 2, )"
                             R"("z": 0.7}, "rotation": {"quaternion": {)" +
                                 number("W", w) + ", " + number("X", x) + ", " + number("Y", y) +
                                 ", " + number("Z", z) + "}}}}]}",
                             {.edge_m = 0.1}, "field.json"))
        .remarks;
  };
  const auto named = Contains(HasSubstr("tag 11 is neither upright nor flat"));
  // Of FTC's library, whose axes of a tag are others.
  EXPECT_THAT(remarks(0.3536, -0.6124, 0.6124, -0.3536), named);
  EXPECT_THAT(remarks(0.3535, 0.6124, -0.6124, 0.3535), named);
  EXPECT_THAT(remarks(0.6, 0, 0, 0.8), Not(named)) << "on a wall";
  EXPECT_THAT(remarks(0.965926, 0, 0.258819, 0), Not(named)) << "leans by 30°, as in FRC 2025";
  EXPECT_THAT(remarks(0.707107, 0, -0.707107, 0), Not(named)) << "on the floor";
}

TEST(MapFormats, OmitTagsThatAreNotUnique) {
  const auto tag = [](int id, const std::string& unique) {
    return "{\"family\": \"apriltag3_36h11_classic\", \"id\": " + std::to_string(id) +
           ", \"size\": 165.1, \"transform\": [1,0,0," + std::to_string(id) +
           ", 0,1,0,0, 0,0,1,0, 0,0,0,1], \"unique\": " + unique + "}";
  };
  const std::string fmap = "{\"fiducials\": [" + tag(1, "0") + "," + tag(2, "1") + "," +
                           tag(3, "false") + "," + tag(4, "true") + "]}";
  const auto read = value_of(read_map(MapFormat::kLimelight, fmap, {}, "field.fmap"));
  ASSERT_EQ(read.map.tags.size(), 2u);
  EXPECT_EQ(read.map.tags[0].tag.tag_id, 2);
  EXPECT_EQ(read.map.tags[1].tag.tag_id, 4);
  EXPECT_THAT(read.remarks, Contains(HasSubstr("not unique have no place and are left out: 1 3")));
}

TEST(MapFormats, TakeTheFamilyFromFileOrOptions) {
  const std::string bundle = "tag_bundles: [{layout: [{id: 1, size: 0.1}]}]\n";
  const auto assumed = read_map(MapFormat::kBundles, bundle, {}, "tags.yaml");
  EXPECT_EQ(assumed->map.family, "tag36h11");
  EXPECT_THAT(assumed->remarks, Contains(HasSubstr("tag36h11 is assumed")));
  const auto given = read_map(MapFormat::kBundles, bundle, {.family = "tag25h9"}, "tags.yaml");
  EXPECT_EQ(given->map.family, "tag25h9");
  EXPECT_THAT(given->remarks, IsEmpty());
  const std::string named = "tag_family: tag16h5\n" + bundle;
  EXPECT_EQ(read_map(MapFormat::kBundles, named, {}, "tags.yaml")->map.family, "tag16h5");
  EXPECT_EQ(read_map(MapFormat::kBundles, named, {.family = "tag25h9"}, "tags.yaml").error().text(),
            "tags.yaml: holds tags of the family tag16h5, not tag25h9");
}

}  // namespace
}  // namespace fiducap
