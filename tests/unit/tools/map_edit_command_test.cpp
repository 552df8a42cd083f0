#include "tools/tags/tag_verbs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "base/whole_file.hpp"
#include "mapping/store/map_store.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

class MapEditCommandTest : public testing::Test {
 protected:
  MapEditCommandTest() {
    arguments_.store = folder_.file("hall.map");
    auto store = MapStore::open(arguments_.store).value();
    TagMap map = make_map({2, 5, 7, 9});
    map.X_RW = {};
    for (const double x : {0.0, 1.0}) {
      map.tags[0].tag.X_WT.p.x() = x;
      map = store.commit(map, kAutomaticComment).value();
    }
  }
  using Run = int (*)(const MapEditArguments&, const Terminal&);
  [[nodiscard]] std::string said_by(Run run, int exit_code = kExitOk) {
    std::ostringstream out;
    std::ostringstream err;
    EXPECT_EQ(run(arguments_, {out, err}), exit_code) << err.str();
    return exit_code == kExitOk ? out.str() : err.str();
  }
  [[nodiscard]] TagMap newest() const {
    return MapStore::open_to_read(arguments_.store).value().newest().value();
  }
  /// Where somebody measured the tags in a room whose axes lie 10 m further.
  void measure(const std::string& more = "") {
    std::ostringstream text;
    text << "# total station, monday\nid,x,y,z\n";
    const TagMap map = newest();
    for (const MapTag& tag : map.tags) {
      const Eigen::Vector3d& p = tag.tag.X_WT.p;
      text << tag.tag.tag_id << ", " << p.x() + 10 << "," << p.y() << "," << p.z() << "\r\n";
    }
    arguments_.measured = folder_.file("measured.csv");
    ASSERT_TRUE(write_whole_file(arguments_.measured, text.str() + more));
  }

  TemporaryFolder folder_;
  MapEditArguments arguments_;
};

TEST_F(MapEditCommandTest, ARollBackIsANewVersionOfTheOldContent) {
  arguments_.version = 1;
  EXPECT_THAT(said_by(run_map_rollback),
              HasSubstr("version 3, 4 tags, parent 1, \"rolled back to version 1\""));
  EXPECT_EQ(newest().tags[0].tag.X_WT.p.x(), 0.0);
  EXPECT_EQ(newest().version, 3);
  arguments_.version = 12;
  EXPECT_THAT(said_by(run_map_rollback, kExitFailed), HasSubstr("no such version"));
}

TEST_F(MapEditCommandTest, ANamedVersionIsKnownByItsNameAndNothingElseChanges) {
  arguments_.version = 1;
  arguments_.name = "before the move";
  EXPECT_THAT(said_by(run_map_name), HasSubstr("version 1 is called \"before the move\""));
  const auto log = MapStore::open_to_read(arguments_.store).value().log().value();
  ASSERT_EQ(log.size(), 2U);
  EXPECT_EQ(log[1].comment, "before the move");
  EXPECT_TRUE(MapStore::open_to_read(arguments_.store).value().load(1)) << "its hash still fits";
  arguments_.name = "two\nlines";
  EXPECT_THAT(said_by(run_map_name, kExitFailed), HasSubstr("1 to 200 characters"));
  arguments_.name = kAutomaticComment;
  EXPECT_THAT(said_by(run_map_name, kExitFailed), HasSubstr("stored by itself"));
  arguments_.version = 9;
  EXPECT_THAT(said_by(run_map_name, kExitFailed), HasSubstr("no such version"));
}

TEST_F(MapEditCommandTest, AnAlignmentTellsWhatIsLeftAtEachTag) {
  measure();
  const std::string said = said_by(run_map_align);
  EXPECT_THAT(said, HasSubstr("    7          0.0    0.0    0.0    0.0\n"));
  EXPECT_THAT(said, HasSubstr("lies at (10.0000 0.0000 0.0000) m in the room"));
  EXPECT_THAT(said, HasSubstr("\"aligned with measured.csv\""));
  EXPECT_NEAR(newest().X_RW.p.x(), 10, 1e-5);
  EXPECT_EQ(newest().parent, 2);
}

TEST_F(MapEditCommandTest, AnAlignmentThatContradictsItselfChangesNothing) {
  measure();
  const std::string text = read_whole_file(arguments_.measured).value();
  ASSERT_TRUE(write_whole_file(arguments_.measured, text + "5,0,0,0\n"));
  EXPECT_THAT(said_by(run_map_align, kExitFailed), HasSubstr("measured.csv: tag 5 is there twice"));
  arguments_.measured = folder_.file("wrong.csv");
  ASSERT_TRUE(write_whole_file(arguments_.measured, "id,x,y,z\n2,0,0\n"));
  EXPECT_THAT(said_by(run_map_align, kExitFailed),
              testing::AllOf(HasSubstr("wrong.csv:2"), HasSubstr("got '2,0,0'")));
  ASSERT_TRUE(write_whole_file(arguments_.measured, "tag,x,y,z\n"));
  EXPECT_THAT(said_by(run_map_align, kExitFailed), HasSubstr("expected the header id,x,y,z"));
  arguments_.measured.clear();
  EXPECT_THAT(said_by(run_map_align, kExitFailed), HasSubstr("needs either --to FILE"));
  EXPECT_EQ(newest().version, 2);
}

TEST_F(MapEditCommandTest, ADistanceIsComparedAndScalesNothing) {
  const TagMap map = newest();
  const double apart = (map.find(5)->tag.X_WT.p - map.find(9)->tag.X_WT.p).norm();
  arguments_.distance = {5, 9, apart + 0.012};
  const std::string said = said_by(run_map_align);
  EXPECT_THAT(said, HasSubstr("tape less map +12.0 mm"));
  EXPECT_THAT(said, HasSubstr("with sigma 1."));
  EXPECT_THAT(said, HasSubstr("nothing was changed"));
  EXPECT_EQ(newest().version, 2);
  arguments_.distance = {5, 77, 1};
  EXPECT_THAT(said_by(run_map_align, kExitFailed), HasSubstr("tag 77 is not in version 2"));
  arguments_.distance = {5, 9.5, 1};
  EXPECT_THAT(said_by(run_map_align, kExitFailed), HasSubstr("two ids of tags and metres"));
}

TEST_F(MapEditCommandTest, TagsAreForgottenAndQuarantined) {
  arguments_.forget = {7};
  arguments_.quarantine = {5};
  EXPECT_THAT(said_by(run_map_edit),
              HasSubstr("3 tags, parent 2, \"edited: tag 7 forgotten, tag 5 quarantined\""));
  EXPECT_EQ(newest().find(7), nullptr);
  EXPECT_EQ(newest().find(5)->state, TagState::kQuarantined);
  EXPECT_THAT(said_by(run_map_edit, kExitFailed), HasSubstr("tag 7 is not in version 3"));
  arguments_.forget.clear();
  arguments_.quarantine.clear();
  EXPECT_THAT(said_by(run_map_edit, kExitFailed), HasSubstr("nothing to change"));
}

TEST_F(MapEditCommandTest, ASurveyedTagStandsWhereItWasMeasured) {
  arguments_.survey = {5, 1, 2, 3};
  arguments_.sigma_m = 0.002;
  (void)said_by(run_map_edit);
  const TagMap map = newest();
  EXPECT_EQ(map.find(5)->state, TagState::kSurveyed);
  EXPECT_EQ(map.find(5)->tag.X_WT.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(map.find(5)->tag.covariance(1, 1), 4e-6, 1e-12);
  arguments_.survey = {6, 1, 2, 3};
  EXPECT_THAT(said_by(run_map_edit, kExitFailed), HasSubstr("tag 6 needs the attitude"));
  arguments_.survey = {6, 1, 2, 3, 1, 0, 0, 0};
  EXPECT_THAT(said_by(run_map_edit, kExitFailed), HasSubstr("tag 6 needs the tag's size"));
  arguments_.tag_size_m = 0.16;
  (void)said_by(run_map_edit);
  EXPECT_EQ(newest().tags.size(), 5U);
  arguments_.survey = {6, 1, 2, 3, 1, 1, 0, 0};
  EXPECT_THAT(said_by(run_map_edit, kExitFailed), HasSubstr("quaternion of length 1"));
  arguments_.survey = {6, 1, 2, 3, 1};
  EXPECT_THAT(said_by(run_map_edit, kExitFailed), HasSubstr("got 5 numbers"));
  arguments_.survey = {6, 1, 2, 3};
  arguments_.sigma_m = 0;
  EXPECT_THAT(said_by(run_map_edit, kExitFailed), HasSubstr("needs its sigma"));
}

TEST_F(MapEditCommandTest, AStoreThatIsNotThereIsNotMade) {
  arguments_.store = folder_.file("nowhere.map");
  arguments_.forget = {7};
  EXPECT_THAT(said_by(run_map_edit, kExitFailed), HasSubstr("no such map store"));
  EXPECT_THAT(said_by(run_map_rollback, kExitFailed), HasSubstr("no such map store"));
}

}  // namespace
}  // namespace fiducap
