// One map out of several recordings of simulated robots.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <sstream>

#include "base/pose.hpp"
#include "base/whole_file.hpp"
#include "capture/recording/recording.hpp"
#include "mapping/store/map_store.hpp"
#include "pipeline/replay/map_build.hpp"
#include "support/temporary_folder.hpp"
#include "tools/command_line.hpp"
#include "tools/tags/map_files.hpp"
#include "tools/terminal.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

constexpr std::int64_t kDay_ns = 86'400'000'000'000;

MapBuildBody between(int first_s, int last_s) {
  MapBuildBody body;
  body.first = instant_from_ns(first_s * 1'000'000'000LL);
  body.last = instant_from_ns(last_s * 1'000'000'000LL);
  return body;
}

TEST(OneAfterTheOther, LeavesThoseThatOverlapAndOrdersTheOthersAsGiven) {
  using std::chrono::seconds;
  // The second overlaps the fourth, the fourth the third; the first is alone, and the newest.
  const std::vector<MapBuildBody> bodies{between(1000, 1100), between(0, 50), between(90, 120),
                                         between(40, 95)};
  const auto later = one_after_the_other(bodies);
  EXPECT_EQ(later[0], Duration{0});
  EXPECT_EQ(later[1], seconds(1110)) << "ten seconds after the end of the first";
  EXPECT_EQ(later[2], later[1]);
  EXPECT_EQ(later[3], later[1]);
  EXPECT_EQ(one_after_the_other({}).size(), 0u);
}

class MapBuildTest : public testing::Test {
 protected:
  /// Two robots over the same table, with an IMU.
  static void SetUpTestSuite() {
    recorded_ = std::make_unique<TemporaryFolder>();
    for (const char* seed : {"1", "2"})
      ASSERT_EQ(MapBuildTest::run({"simulate", "--room", "table", "--seconds", "15", "--seed", seed,
                                   "--out", recorded_->file(std::string("robot") + seed)}),
                kExitOk);
  }
  static void TearDownTestSuite() { recorded_.reset(); }

  static int run(const std::vector<std::string>& words) {
    std::vector<const char*> argv{"fiducap"};
    for (const std::string& word : words) argv.push_back(word.c_str());
    out_.str("");
    err_.str("");
    return run_command_line(static_cast<int>(argv.size()), argv.data(), {out_, err_});
  }
  int build(std::vector<std::string> recordings, const std::vector<std::string>& more = {}) {
    recordings.insert(recordings.begin(), {"map", "build"});
    recordings.insert(recordings.end(), {"--out", file()});
    recordings.insert(recordings.end(), more.begin(), more.end());
    return run(recordings);
  }
  static std::string robot(int number) { return recorded_->file("robot" + std::to_string(number)); }
  [[nodiscard]] std::string file() const { return folder_.file("map.yaml"); }

  /// A copy of a robot's recording, another one.
  [[nodiscard]] std::string copy(int number, const std::string& name) const {
    fs::copy(robot(number), folder_.file(name), fs::copy_options::recursive);
    return folder_.file(name);
  }
  /// Every line of a table goes through `change`, by its fields; the header stays.
  static void rewrite(const std::string& path,
                      const std::function<void(std::vector<std::string>&)>& change) {
    std::istringstream lines(*read_whole_file(path));
    std::string text;
    for (std::string line; std::getline(lines, line);) {
      std::vector<std::string> fields;
      std::istringstream rest(line);
      for (std::string field; std::getline(rest, field, ',');) fields.push_back(field);
      if (!line.starts_with('#')) change(fields);
      for (std::size_t i = 0; i < fields.size(); ++i) text += (i > 0 ? "," : "") + fields[i];
      if (!fields.empty()) text += "\n";
    }
    ASSERT_TRUE(write_whole_file(path, text));
  }
  static void replace(const std::string& path, const std::string& what, const std::string& by) {
    std::string text = *read_whole_file(path);
    ASSERT_NE(text.find(what), std::string::npos);
    ASSERT_TRUE(write_whole_file(path, text.replace(text.find(what), what.size(), by)));
  }
  /// How far tags are from where they really are, seen from the first.
  [[nodiscard]] double worst_error_m() const {
    const auto map = read_map_file(file());
    const auto truth = read_truth_tags(robot(1));
    if (!map || map->tags.size() != truth->size()) return 1e9;
    const auto place = [](const auto& tags, auto X_WT) {
      std::vector<Eigen::Vector3d> places;
      for (const auto& tag : tags) places.push_back((X_WT(tags.front()).inverse() * X_WT(tag)).p);
      return places;
    };
    const auto is = place(*truth, [](const RecordedTag& tag) { return tag.X_WT; });
    const auto found = place(map->tags, [](const MapTag& entry) { return entry.tag.X_WT; });
    double worst = 0;
    for (std::size_t i = 0; i < is.size(); ++i) worst = std::max(worst, (is[i] - found[i]).norm());
    return worst;
  }

  static std::unique_ptr<TemporaryFolder> recorded_;
  static std::ostringstream out_;
  static std::ostringstream err_;
  TemporaryFolder folder_;
};

std::unique_ptr<TemporaryFolder> MapBuildTest::recorded_;
std::ostringstream MapBuildTest::out_;
std::ostringstream MapBuildTest::err_;

// Corners of 0.4 px, a table of a metre: a tenth of what one image would say.
constexpr double kMap_m = 0.002;

TEST_F(MapBuildTest, RobotsThatMoveTogetherGiveOneMap) {
  ASSERT_EQ(build({robot(1), robot(2)}), kExitOk) << err_.str();
  EXPECT_LT(worst_error_m(), kMap_m);
  EXPECT_THAT(out_.str(), AllOf(HasSubstr("3 tags placed of 3 seen"), HasSubstr("joined"),
                                HasSubstr("1-sigma of a tag")));
  EXPECT_THAT(out_.str(), testing::Not(HasSubstr("did not join")));
}

TEST_F(MapBuildTest, ARobotOfAnotherDayJoinsWhoeverCameFirst) {
  const std::string other = copy(2, "other_day");
  for (const char* table : {"imu0/data.csv", "tags0/data.csv", "tags0/frames.csv"})
    rewrite(other + "/mav0/" + table,
            [](auto& f) { f[0] = std::to_string(std::stoll(f[0]) + kDay_ns); });
  for (const auto& order : {std::vector{robot(1), other}, std::vector{other, robot(1)}}) {
    ASSERT_EQ(build(order), kExitOk) << err_.str();
    EXPECT_LT(worst_error_m(), kMap_m);
    EXPECT_THAT(out_.str(), testing::Not(HasSubstr("did not join")));
  }
}

TEST_F(MapBuildTest, PrintsOfAnotherSizeThanToldAreSaidAndTheMapIsRight) {
  ASSERT_EQ(build({robot(1), robot(2)}, {"--set", "tags.size_m=0.1632"}), kExitOk) << err_.str();
  EXPECT_THAT(err_.str(), AllOf(HasSubstr("all tags seem"), HasSubstr("% smaller")));
  EXPECT_LT(worst_error_m(), kMap_m);
  ASSERT_EQ(build({robot(1), robot(2)}), kExitOk) << err_.str();
  EXPECT_THAT(err_.str(), testing::Not(HasSubstr("all tags seem")));
}

TEST_F(MapBuildTest, ARobotThatSawOtherTagsIsSaidWithWhatToDo) {
  const std::string elsewhere = copy(2, "elsewhere");
  rewrite(elsewhere + "/mav0/tags0/data.csv",
          [](auto& f) { f[1] = std::to_string(std::stoi(f[1]) + 100); });
  ASSERT_EQ(build({robot(1), elsewhere}), kExitOk);
  EXPECT_LT(worst_error_m(), kMap_m) << "the map is that of the first";
  EXPECT_THAT(out_.str(), HasSubstr("did not join"));
  EXPECT_THAT(err_.str(), AllOf(HasSubstr("tags 100, 101, 102 of " + elsewhere),
                                HasSubstr("Walk so that one tag is seen by both")));
}

TEST_F(MapBuildTest, WithoutItsReferenceTagTheMapIsWhereTheRobotBegan) {
  const std::string elsewhere = copy(1, "elsewhere");
  rewrite(elsewhere + "/mav0/tags0/data.csv",
          [](auto& f) { f[1] = std::to_string(std::stoi(f[1]) + 100); });
  ASSERT_EQ(build({elsewhere}), kExitOk);
  EXPECT_LT(worst_error_m(), kMap_m);
  EXPECT_THAT(err_.str(), HasSubstr("no recording shows the reference tag 0"));
}

TEST_F(MapBuildTest, WithoutTagsNothingIsWritten) {
  const std::string blind = copy(1, "blind");
  ASSERT_TRUE(write_whole_file(blind + "/mav0/tags0/data.csv", "#t,id\n"));
  rewrite(blind + "/mav0/tags0/frames.csv", [](auto& f) { f[1] = "0"; });
  EXPECT_EQ(build({blind}), kExitFailed);
  EXPECT_FALSE(fs::exists(file()));
  EXPECT_THAT(err_.str(), AllOf(HasSubstr("blind"), HasSubstr("tag")));
  EXPECT_EQ(build({robot(1), blind}), kExitOk) << "the other has seen some";
  EXPECT_THAT(err_.str(), HasSubstr("no tag was found in its"));
}

TEST_F(MapBuildTest, WithoutAnImuUpIsSaidToBeAGuess) {
  ASSERT_EQ(run({"simulate", "--room", "table", "--seconds", "15", "--no-imu", "--out",
                 folder_.file("slow")}),
            kExitOk);
  ASSERT_EQ(build({folder_.file("slow")}), kExitOk) << err_.str();
  EXPECT_LT(worst_error_m(), kMap_m);
  EXPECT_THAT(err_.str(), HasSubstr("the vertical is a guess"));
  EXPECT_EQ(build({robot(1), folder_.file("slow")}), kExitOk) << err_.str();
  EXPECT_THAT(err_.str(), testing::Not(HasSubstr("guess"))) << "the other has felt it";
}

TEST_F(MapBuildTest, RecordingsOfDifferentTagsAreNotMixed) {
  const std::string other = copy(2, "other");
  replace(other + "/mav0/tags.yaml", "tag36h11", "tag25h9");
  EXPECT_EQ(build({robot(1), other}), kExitFailed);
  EXPECT_THAT(err_.str(), AllOf(HasSubstr("the family of the tags is tag25h9 here and tag36h11"),
                                HasSubstr("--set tags.family")));
  EXPECT_EQ(build({robot(1), robot(1)}), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("is given twice"));
}

TEST_F(MapBuildTest, GivenTagsStayAndTheRestIsLaidOutAroundThem) {
  const std::string survey = folder_.file("survey.csv");
  std::istringstream lines(*read_whole_file(robot(1) + "/truth/tags.csv"));
  std::string text;
  for (std::string line; std::getline(lines, line);)
    if (!line.starts_with("2,")) text += line + "\n";
  ASSERT_TRUE(write_whole_file(survey, text));
  ASSERT_EQ(build({robot(1)}, {"--map", survey}), kExitOk) << err_.str();
  EXPECT_THAT(out_.str(), HasSubstr("1 tags placed of 3 seen, 2 given"));
  EXPECT_LT(worst_error_m(), kMap_m);

  // A single one, and a robot that does not feel what is up.
  ASSERT_EQ(run({"simulate", "--room", "table", "--seconds", "15", "--no-imu", "--out",
                 folder_.file("slow")}),
            kExitOk);
  replace(folder_.file("slow") + "/mav0/tags.yaml", "reference_tag: 0", "reference_tag: 1");
  ASSERT_TRUE(write_whole_file(survey,
                               "id,size,px,py,pz,qw,qx,qy,qz\n"
                               "1,0.16,3,4,5,0.8,0.6,0,0\n"));
  ASSERT_EQ(build({folder_.file("slow")}, {"--map", survey}), kExitOk) << err_.str();
  EXPECT_LT(worst_error_m(), kMap_m) << "the given tag fits the others";

  EXPECT_EQ(build({robot(1)}, {"--map", robot(1) + "/truth/tags.csv"}), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("beside those that were given"));
}

TEST_F(MapBuildTest, GoesIntoAStoreAsTheNextVersion) {
  const std::string store = folder_.file("hall.map");
  ASSERT_EQ(run({"map", "build", robot(1), "--store", store, "--comment", "monday"}), kExitOk);
  ASSERT_EQ(run({"map", "build", robot(1), robot(2), "--store", store}), kExitOk) << err_.str();
  EXPECT_THAT(out_.str(), HasSubstr("version 2, 3 tags"));
  ASSERT_EQ(run({"map", "log", "--store", store}), kExitOk);
  EXPECT_THAT(out_.str(), AllOf(HasSubstr("monday"), HasSubstr("built from 2 recordings")));
  EXPECT_EQ(run({"map", "build", robot(1)}), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("needs --out FILE or --store FILE"));
}

}  // namespace
}  // namespace fiducap
