#include "tools/tags/tag_verbs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "mapping/store/sqlite_file.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr const char* kHeader = "id,size,px,py,pz,qw,qx,qy,qz\n";

class MapCommandTest : public ::testing::Test {
 protected:
  MapCommandTest() { arguments_.store = folder_.file("hall.map"); }

  int import(const std::string& rows) {
    arguments_.file = folder_.file("in.csv");
    EXPECT_TRUE(write_whole_file(arguments_.file, kHeader + rows));
    return run_map_import(arguments_, terminal_);
  }
  std::string taken() {
    std::string text = out_.str();
    out_.str({});
    return text;
  }

  TemporaryFolder folder_;
  std::ostringstream out_;
  std::ostringstream err_;
  Terminal terminal_{out_, err_};
  MapArguments arguments_;
};

TEST_F(MapCommandTest, ImportedVersionsAreLoggedNewestFirst) {
  ASSERT_EQ(import("1,0.16,0,0,0,1,0,0,0\n"), kExitOk) << err_.str();
  arguments_.comment = "after moving tag 1";
  ASSERT_EQ(import("1,0.16,1,0,0,1,0,0,0\n"), kExitOk) << err_.str();
  taken();
  arguments_.json = true;
  ASSERT_EQ(run_map_log(arguments_, terminal_), kExitOk);
  const auto log = nlohmann::json::parse(taken());
  ASSERT_EQ(log.size(), 2u);
  EXPECT_EQ(log[0]["comment"], "after moving tag 1");
  EXPECT_EQ(log[0]["parent"], log[1]["version"]);
  EXPECT_EQ(log[1]["comment"], "import of in.csv");
  EXPECT_GT(log[1]["created_utc_ns"], 0);
}

TEST_F(MapCommandTest, DiffSpeaksMillimetresAndDegrees) {
  ASSERT_EQ(import("1,0.16,0,0,0,1,0,0,0\n2,0.16,0,0,0,1,0,0,0\n"), kExitOk);
  // Moved by 12 mm and turned by 60 degrees about z: cos 30° = 0.8660254037844387.
  ASSERT_EQ(import("1,0.16,0.012,0,0,0.8660254037844387,0,0,0.5\n3,0.16,0,0,0,1,0,0,0\n"), kExitOk);
  taken();
  ASSERT_EQ(run_map_diff(arguments_, terminal_), kExitOk) << err_.str();
  const std::string text = taken();
  EXPECT_THAT(text, HasSubstr("3 tags differ"));
  EXPECT_THAT(text, HasSubstr("    1 moved      12.000 mm  60.0000 deg\n"));
  EXPECT_THAT(text, HasSubstr("    2 removed\n"));
  EXPECT_THAT(text, HasSubstr("    3 added\n"));
}

TEST_F(MapCommandTest, ExportReadsBackAsTheSameMap) {
  ASSERT_EQ(import("1,0.16,0.1,0.2,0.3,0.8660254037844387,0,0,0.5\n"), kExitOk);
  arguments_.file = folder_.file("out.yaml");
  ASSERT_EQ(run_map_export(arguments_, terminal_), kExitOk) << err_.str();
  ASSERT_EQ(run_map_import(arguments_, terminal_), kExitOk) << err_.str();
  taken();
  ASSERT_EQ(run_map_diff(arguments_, terminal_), kExitOk);
  EXPECT_THAT(taken(), HasSubstr("no tag differs"));
}

TEST_F(MapCommandTest, ShowsOneVersion) {
  ASSERT_EQ(import("7,0.16,0.1,0.2,0.3,1,0,0,0\n"), kExitOk);
  ASSERT_EQ(import("8,0.16,0.1,0.2,0.3,1,0,0,0\n"), kExitOk);
  taken();
  arguments_.json = true;
  arguments_.version = 1;
  ASSERT_EQ(run_map_show(arguments_, terminal_), kExitOk) << err_.str();
  const auto map = nlohmann::json::parse(taken());
  ASSERT_EQ(map["tags"].size(), 1u);
  EXPECT_EQ(map["tags"][0]["id"], 7);
  EXPECT_DOUBLE_EQ(map["tags"][0]["position_m"][2], 0.3);
}

TEST_F(MapCommandTest, UnknownVersionsAndFormatsAreRefused) {
  ASSERT_EQ(import("7,0.16,0.1,0.2,0.3,1,0,0,0\n"), kExitOk);
  arguments_.version = 5;
  EXPECT_EQ(run_map_show(arguments_, terminal_), kExitFailed);
  arguments_.version.reset();
  arguments_.file = folder_.file("out.xyz");
  EXPECT_EQ(run_map_export(arguments_, terminal_), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr(".yaml or .csv"));
}

TEST_F(MapCommandTest, WpilibFilesNeedTheTagSize) {
  arguments_.file = folder_.file("field.json");
  ASSERT_TRUE(write_whole_file(arguments_.file, "{}"));
  EXPECT_EQ(run_map_import(arguments_, terminal_), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("--tag-size"));
}

TEST_F(MapCommandTest, OtherProgramsMapsGoOutAndComeInAgain) {
  ASSERT_EQ(import("1,0.2,0.1,0.2,0.3,0.8660254037844387,0,0,0.5\n"), kExitOk);
  for (const char* format : {"tagslam", "apriltag_ros", "rcars", "aruco", "wpilib"}) {
    arguments_.file = folder_.file("out.yaml");
    arguments_.format = format;
    arguments_.tag_size_m.reset();
    ASSERT_EQ(run_map_export(arguments_, terminal_), kExitOk) << err_.str();
    arguments_.format.clear();  // what stands in it says it
    arguments_.tag_size_m = 0.2;
    ASSERT_EQ(run_map_import(arguments_, terminal_), kExitOk) << err_.str();
    taken();
    ASSERT_EQ(run_map_diff(arguments_, terminal_), kExitOk);
    EXPECT_THAT(taken(), HasSubstr("no tag differs")) << format;
  }
}

TEST_F(MapCommandTest, WhatWasAssumedIsSaidBesideTheResult) {
  arguments_.file = folder_.file("tags.yaml");
  ASSERT_TRUE(write_whole_file(arguments_.file,
                               "standalone_tags: [{id: 4, size: 0.1}]\n"
                               "tag_bundles: [{layout: [{id: 1, size: 0.1, z: 1}]}]\n"));
  ASSERT_EQ(run_map_import(arguments_, terminal_), kExitOk) << err_.str();
  EXPECT_THAT(err_.str(), HasSubstr("standalone tag 4 left out: no place is given"));
  EXPECT_THAT(err_.str(), HasSubstr("tag36h11 is assumed"));
  arguments_.file = folder_.file("field.json");
  arguments_.field_m = {16.5, 8.25};
  ASSERT_EQ(run_map_export(arguments_, terminal_), kExitOk) << err_.str();
  EXPECT_THAT(err_.str(), HasSubstr("sizes are not part of this format: all tags are 0.1 m"));
  const auto text = read_whole_file(arguments_.file);
  ASSERT_TRUE(text);
  EXPECT_EQ(nlohmann::json::parse(*text)["field"]["width"], 8.25);
}

TEST_F(MapCommandTest, WorksBesideADamagedNewestVersion) {
  ASSERT_EQ(import("7,0.16,0.1,0.2,0.3,1,0,0,0\n"), kExitOk);
  ASSERT_EQ(import("8,0.16,0.1,0.2,0.3,1,0,0,0\n"), kExitOk);
  EXPECT_EQ(run_map_check(arguments_, terminal_), kExitOk);
  ASSERT_TRUE(
      SqliteFile::open(arguments_.store)->execute("UPDATE tag SET px = 9 WHERE version = 2"));
  taken();
  EXPECT_EQ(run_map_check(arguments_, terminal_), kExitFailed);
  EXPECT_THAT(taken(), HasSubstr("version 2: is damaged"));
  arguments_.file = folder_.file("out.yaml");
  EXPECT_EQ(run_map_export(arguments_, terminal_), kExitOk) << err_.str();
  EXPECT_THAT(taken(), HasSubstr("version 1"));
  EXPECT_THAT(err_.str(), HasSubstr("passed over version 2"));
  EXPECT_EQ(run_map_import(arguments_, terminal_), kExitOk) << err_.str();
  EXPECT_THAT(taken(), HasSubstr("version 3"));
  EXPECT_EQ(run_map_log(arguments_, terminal_), kExitOk);
  taken();
  EXPECT_EQ(run_map_repair(arguments_, terminal_), kExitOk);
  const std::string said = taken();
  EXPECT_THAT(said, HasSubstr("lost: version 2"));
  EXPECT_THAT(said, HasSubstr("is kept as " + arguments_.store + ".damaged-1"));
  EXPECT_EQ(run_map_check(arguments_, terminal_), kExitOk);
  EXPECT_EQ(run_map_repair(arguments_, terminal_), kExitOk);
  EXPECT_THAT(taken(), HasSubstr("nothing was changed"));
}

TEST_F(MapCommandTest, LookingDoesNotMakeAStore) {
  EXPECT_EQ(run_map_check(arguments_, terminal_), kExitFailed);
  EXPECT_EQ(run_map_repair(arguments_, terminal_), kExitFailed);

  EXPECT_EQ(run_map_log(arguments_, terminal_), kExitFailed);
  EXPECT_FALSE(std::filesystem::exists(arguments_.store));
}

}  // namespace
}  // namespace fiducap
