#include <gmock/gmock.h>

#include <sstream>

#include <nlohmann/json.hpp>

#include "mapping/store/map_store.hpp"
#include "mapping/store/sqlite_file.hpp"
#include "support/command_run.hpp"
#include "support/results.hpp"
#include "tools/tags/tag_verbs.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class MapCommandTest : public VerbTest<MapArguments> {
 protected:
  MapCommandTest() { arguments_.store = folder_.file("hall.map"); }

  std::string import(const std::string& rows) {
    arguments_.file = folder_.write("in.csv", "id,size,px,py,pz,qw,qx,qy,qz\n" + rows);
    return run(run_map_import);
  }
};

TEST_F(MapCommandTest, LogListsVersionsNewestFirst) {
  import("1,0.16,0,0,0,1,0,0,0\n");
  arguments_.comment = "after moving tag 1";
  import("1,0.16,1,0,0,1,0,0,0\n");
  arguments_.json = true;
  const auto log = nlohmann::json::parse(run(run_map_log));
  ASSERT_EQ(log.size(), 2u);
  EXPECT_EQ(log[0]["comment"], "after moving tag 1");
  EXPECT_EQ(log[0]["parent"], log[1]["version"]);
  EXPECT_EQ(log[1]["comment"], "import of in.csv");
  EXPECT_GT(log[1]["created_utc_ns"], 0);
}

TEST_F(MapCommandTest, DiffIsInMillimetresAndDegrees) {
  import("1,0.16,0,0,0,1,0,0,0\n2,0.16,1,0,0,1,0,0,0\n");
  // Moved by 12 mm, rotated by 60 degrees about z: cos 30° = 0.8660254037844387.
  import("1,0.16,0.012,0,0,0.8660254037844387,0,0,0.5\n3,0.16,2,0,0,1,0,0,0\n");
  EXPECT_THAT(run(run_map_diff), AllOf(HasSubstr("3 tags differ"),
                                       HasSubstr("    1 moved      12.000 mm  60.0000 deg\n"),
                                       HasSubstr("    2 removed\n"), HasSubstr("    3 added\n")));
}

TEST_F(MapCommandTest, ExportedMapsImportAsTheSameMap) {
  import("1,0.2,0.1,0.2,0.3,0.8660254037844387,0,0,0.5\n");
  arguments_.file = folder_.file("out.yaml");
  for (const char* format :
       {"", "tagslam", "apriltag_ros", "rcars", "aruco", "wpilib", "limelight"}) {
    SCOPED_TRACE(format);
    arguments_.format = format;
    arguments_.tag_size_m.reset();
    run(run_map_export);
    arguments_.format.clear();  // the content determines it
    if (*format != '\0') arguments_.tag_size_m = 0.2;
    run(run_map_import);
    EXPECT_THAT(run(run_map_diff), HasSubstr("no tag differs"));
  }
}

TEST_F(MapCommandTest, ShowsOneVersion) {
  import("7,0.16,0.1,0.2,0.3,1,0,0,0\n");
  import("8,0.16,0.1,0.2,0.3,1,0,0,0\n");
  arguments_.json = true;
  arguments_.version = 1;
  const auto map = nlohmann::json::parse(run(run_map_show));
  ASSERT_EQ(map["tags"].size(), 1u);
  EXPECT_EQ(map["tags"][0]["id"], 7);
  EXPECT_DOUBLE_EQ(map["tags"][0]["position_m"][2], 0.3);
}

TEST_F(MapCommandTest, RefusesUnknownVersionsAndFormats) {
  import("7,0.16,0.1,0.2,0.3,1,0,0,0\n");
  arguments_.version = 5;
  run(run_map_show, kExitFailed);
  arguments_.version.reset();
  arguments_.file = folder_.file("out.xyz");
  EXPECT_THAT(refused(run_map_export), HasSubstr(".yaml or .csv"));
  arguments_.file = folder_.write("field.json", "{}");  // WPILib
  EXPECT_THAT(refused(run_map_import), HasSubstr("--tag-size"));
}

TEST_F(MapCommandTest, ReportsAssumptions) {
  arguments_.file = folder_.write("tags.yaml",
                                  "standalone_tags: [{id: 4, size: 0.1}]\n"
                                  "tag_bundles: [{layout: [{id: 1, size: 0.1, z: 1}]}]\n");
  run(run_map_import);
  EXPECT_THAT(err_, AllOf(HasSubstr("standalone tag 4 left out: no place is given"),
                          HasSubstr("tag36h11 is assumed")));
  arguments_.file = folder_.file("field.json");
  arguments_.field_m = {16.5, 8.25};
  run(run_map_export);
  EXPECT_THAT(err_, HasSubstr("sizes are not part of this format: all tags are 0.1 m"));
  const auto field = nlohmann::json::parse(content_of(arguments_.file))["field"];
  EXPECT_EQ(field["width"], 8.25);
}

TEST_F(MapCommandTest, SkipsAndRepairsADamagedVersion) {
  import("7,0.16,0.1,0.2,0.3,1,0,0,0\n");
  import("8,0.16,0.1,0.2,0.3,1,0,0,0\n");
  run(run_map_check);
  ASSERT_TRUE(
      SqliteFile::open(arguments_.store)->execute("UPDATE tag SET px = 9 WHERE version = 2"));
  EXPECT_THAT(run(run_map_check, kExitFailed), HasSubstr("version 2: is damaged"));
  arguments_.file = folder_.file("out.yaml");
  EXPECT_THAT(run(run_map_export), HasSubstr("version 1"));
  EXPECT_THAT(err_, HasSubstr("passed over version 2"));
  EXPECT_THAT(run(run_map_import), HasSubstr("version 3"));
  run(run_map_log);
  EXPECT_THAT(run(run_map_repair),
              AllOf(HasSubstr("lost: version 2"),
                    HasSubstr("is kept as " + arguments_.store + ".damaged-1")));
  run(run_map_check);
  EXPECT_THAT(run(run_map_repair), HasSubstr("nothing was changed"));
}

TEST_F(MapCommandTest, ReadingCreatesNoStore) {
  for (const Verb verb : {run_map_check, run_map_repair, run_map_log}) run(verb, kExitFailed);
  EXPECT_FALSE(std::filesystem::exists(arguments_.store));
}

class MapEditCommandTest : public VerbTest<MapArguments> {
 protected:
  MapEditCommandTest() {
    arguments_.store = folder_.file("hall.map");
    auto store = value_of(MapStore::open(arguments_.store));
    TagMap map = make_map({2, 5, 7, 9});
    map.X_RW = {};
    for (const double x : {0.0, 1.0}) {
      map.tags[0].tag.X_WT.p.x() = x;
      map = value_of(store.commit(map, kAutomaticComment));
    }
  }
  [[nodiscard]] MapStore store() const {
    return value_of(MapStore::open_to_read(arguments_.store));
  }
  [[nodiscard]] TagMap newest() const { return store().newest().value(); }
  /// A survey of the tags in a room whose axes lie 10 m further.
  [[nodiscard]] std::string survey() const {
    std::ostringstream text;
    text << "# total station, monday\nid,x,y,z\n";
    for (const TagMap map = newest(); const MapTag& tag : map.tags) {
      const Eigen::Vector3d& p = tag.tag.X_WT.p;
      text << tag.tag.tag_id << ", " << p.x() + 10 << "," << p.y() << "," << p.z() << "\r\n";
    }
    return text.str();
  }
};

TEST_F(MapEditCommandTest, RollBackMakesNewVersionOfOldContent) {
  arguments_.version = 1;
  EXPECT_THAT(run(run_map_rollback),
              HasSubstr("version 3, 4 tags, parent 1, \"rolled back to version 1\""));
  EXPECT_EQ(newest().tags[0].tag.X_WT.p.x(), 0.0);
  EXPECT_EQ(newest().version, 3);
  arguments_.version = 12;
  EXPECT_THAT(refused(run_map_rollback), HasSubstr("no such version"));
}

TEST_F(MapEditCommandTest, NamingAVersionChangesNothingElse) {
  arguments_.version = 1;
  arguments_.name = "before the move";
  EXPECT_THAT(run(run_map_name), HasSubstr("version 1 is called \"before the move\""));
  const auto log = value_of(store().log());
  ASSERT_EQ(log.size(), 2U);
  EXPECT_EQ(log[1].comment, "before the move");
  EXPECT_TRUE(store().load(1)) << "its hash is still right";
  arguments_.name = "two\nlines";
  EXPECT_THAT(refused(run_map_name), HasSubstr("1 to 200 characters"));
  arguments_.name = kAutomaticComment;
  EXPECT_THAT(refused(run_map_name), HasSubstr("stored by itself"));
  arguments_.version = 9;
  EXPECT_THAT(refused(run_map_name), HasSubstr("no such version"));
}

TEST_F(MapEditCommandTest, AlignmentReportsTheResidualOfEachTag) {
  arguments_.measured = folder_.write("measured.csv", survey());
  EXPECT_THAT(run(run_map_align), AllOf(HasSubstr("    7          0.0    0.0    0.0    0.0\n"),
                                        HasSubstr("lies at (10.0000 0.0000 0.0000) m in the room"),
                                        HasSubstr("\"aligned with measured.csv\"")));
  EXPECT_NEAR(newest().X_RW.p.x(), 10, 1e-5);
  EXPECT_EQ(newest().parent, 2);
}

TEST_F(MapEditCommandTest, UnusableAlignmentChangesNothing) {
  arguments_.measured = folder_.write("measured.csv", survey() + "5,0,0,0\n");
  EXPECT_THAT(refused(run_map_align), HasSubstr("measured.csv: tag 5 is there twice"));
  arguments_.measured = folder_.write("wrong.csv", "id,x,y,z\n2,0,0\n");
  EXPECT_THAT(refused(run_map_align), AllOf(HasSubstr("wrong.csv:2"), HasSubstr("got '2,0,0'")));
  folder_.write("wrong.csv", "tag,x,y,z\n");
  EXPECT_THAT(refused(run_map_align), HasSubstr("expected the header id,x,y,z"));
  arguments_.measured.clear();
  EXPECT_THAT(refused(run_map_align), HasSubstr("needs either --to FILE"));
  EXPECT_EQ(newest().version, 2);
}

TEST_F(MapEditCommandTest, DistanceIsComparedAndNotApplied) {
  const TagMap map = newest();
  const double distance_m = (map.find(5)->tag.X_WT.p - map.find(9)->tag.X_WT.p).norm();
  arguments_.distance = {5, 9, distance_m + 0.012};
  EXPECT_THAT(run(run_map_align),
              AllOf(HasSubstr("tape less map +12.0 mm"), HasSubstr("with sigma 1."),
                    HasSubstr("nothing was changed")));
  EXPECT_EQ(newest().version, 2);
  arguments_.distance = {5, 77, 1};
  EXPECT_THAT(refused(run_map_align), HasSubstr("tag 77 is not in version 2"));
  arguments_.distance = {5, 9.5, 1};
  EXPECT_THAT(refused(run_map_align), HasSubstr("two ids of tags and metres"));
}

TEST_F(MapEditCommandTest, ForgetsAndQuarantinesTags) {
  arguments_.forget = {7};
  arguments_.quarantine = {5};
  EXPECT_THAT(run(run_map_edit),
              HasSubstr("3 tags, parent 2, \"edited: tag 7 forgotten, tag 5 quarantined\""));
  EXPECT_EQ(newest().find(7), nullptr);
  EXPECT_EQ(newest().find(5)->state, TagState::kQuarantined);
  EXPECT_THAT(refused(run_map_edit), HasSubstr("tag 7 is not in version 3"));
  arguments_.forget.clear();
  arguments_.quarantine.clear();
  EXPECT_THAT(refused(run_map_edit), HasSubstr("nothing to change"));
}

TEST_F(MapEditCommandTest, SurveyedTagHasTheSurveyedPlace) {
  arguments_.survey = {5, 1, 2, 3};
  arguments_.sigma_m = 0.002;
  run(run_map_edit);
  const TagMap map = newest();
  EXPECT_EQ(map.find(5)->state, TagState::kSurveyed);
  EXPECT_EQ(map.find(5)->tag.X_WT.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(map.find(5)->tag.covariance(1, 1), 4e-6, 1e-12);
  arguments_.survey = {6, 1, 2, 3};
  EXPECT_THAT(refused(run_map_edit), HasSubstr("tag 6 needs the attitude"));
  arguments_.survey = {6, 1, 2, 3, 1, 0, 0, 0};
  EXPECT_THAT(refused(run_map_edit), HasSubstr("tag 6 needs the tag's size"));
  arguments_.tag_size_m = 0.16;
  run(run_map_edit);
  EXPECT_EQ(newest().tags.size(), 5U);
  arguments_.survey = {6, 1, 2, 3, 1, 1, 0, 0};
  EXPECT_THAT(refused(run_map_edit), HasSubstr("quaternion of length 1"));
  arguments_.survey = {6, 1, 2, 3, 1};
  EXPECT_THAT(refused(run_map_edit), HasSubstr("got 5 numbers"));
  arguments_.survey = {6, 1, 2, 3};
  arguments_.sigma_m = 0;
  EXPECT_THAT(refused(run_map_edit), HasSubstr("needs its sigma"));
}

TEST_F(MapEditCommandTest, CreatesNoStore) {
  arguments_.store = folder_.file("nowhere.map");
  arguments_.forget = {7};
  EXPECT_THAT(refused(run_map_edit), HasSubstr("no such map store"));
  EXPECT_THAT(refused(run_map_rollback), HasSubstr("no such map store"));
}

}  // namespace
}  // namespace fiducap
