// One map out of several recordings of simulated robots.
#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <memory>

#include "base/whole_file.hpp"
#include "capture/recording/recording.hpp"
#include "mapping/store/map_store.hpp"
#include "pipeline/replay/map_build.hpp"
#include "support/command_run.hpp"
#include "support/replaced.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/tags/map_files.hpp"
#include "unit/tools/csv_rows.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

TEST(OneAfterTheOther, DelaysRecordingsThatDoNotOverlap) {
  using std::chrono::seconds;
  const auto between = [](int first_s, int last_s) {
    MapBuildBody body;
    body.first = instant_from_ns(first_s * 1'000'000'000LL);
    body.last = instant_from_ns(last_s * 1'000'000'000LL);
    return body;
  };
  // The second overlaps the fourth, the fourth the third; the first is alone, and the newest.
  const std::vector<MapBuildBody> bodies{between(1000, 1100), between(0, 50), between(90, 120),
                                         between(40, 95)};
  const Duration later = seconds(1110);  // ten seconds after the end of the first
  EXPECT_THAT(one_after_the_other(bodies), testing::ElementsAre(Duration{0}, later, later, later));
  EXPECT_THAT(one_after_the_other({}), testing::IsEmpty());
}

class MapBuildTest : public testing::Test {
 protected:
  /// Two robots over the same table, with an IMU.
  static void SetUpTestSuite() {
    recorded_ = std::make_unique<TemporaryFolder>();
    for (const char* seed : {"1", "2"})
      simulate(recorded_->file(std::string("robot") + seed), seed);
  }
  static void TearDownTestSuite() { recorded_.reset(); }

  static void simulate(const std::string& out, const char* seed, bool imu = true) {
    std::vector<std::string> words{"simulate", "--room", "table",  "--seconds", "8",
                                   "--out",    out,      "--seed", seed};
    if (!imu) words.push_back("--no-imu");
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, kExitOk) << run.err;
  }
  void run(const std::vector<std::string>& words, int exit_code = kExitOk) {
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, exit_code) << run.err;
    out_ = run.out;
    err_ = run.err;
  }
  void build(std::vector<std::string> recordings, const std::vector<std::string>& more = {},
             int exit_code = kExitOk) {
    recordings.insert(recordings.begin(), {"map", "build"});
    recordings.insert(recordings.end(), {"--out", file()});
    recordings.insert(recordings.end(), more.begin(), more.end());
    run(recordings, exit_code);
  }
  static std::string robot(int number) { return recorded_->file("robot" + std::to_string(number)); }
  [[nodiscard]] std::string file() const { return folder_.file("map.yaml"); }

  /// A copy of a robot's recording.
  [[nodiscard]] std::string copy(int number, const std::string& name) const {
    fs::copy(robot(number), folder_.file(name), fs::copy_options::recursive);
    return folder_.file(name);
  }
  /// Its tags have other ids.
  [[nodiscard]] std::string copy_with_other_tags(int number) const {
    const std::string path = copy(number, "elsewhere");
    change_csv(path + "/mav0/tags0/data.csv",
               each_row([](CsvRow& f) { f[1] = std::to_string(std::stoi(f[1]) + 100); }));
    return path;
  }
  static void replace(const std::string& path, const std::string& from, const std::string& to) {
    value_of(write_whole_file(path, replaced(content_of(path), from, to)));
  }
  /// The largest distance of a tag from its true place, in the axes of the first tag.
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
  std::string out_, err_;
  TemporaryFolder folder_;
};

std::unique_ptr<TemporaryFolder> MapBuildTest::recorded_;

// Corners of 0.4 px, a table of a metre: a tenth of what one image would give.
constexpr double kMap_m = 0.002;

TEST_F(MapBuildTest, SimultaneousRobotsGiveOneMap) {
  build({robot(1), robot(2)});
  EXPECT_LT(worst_error_m(), kMap_m);
  EXPECT_THAT(out_, AllOf(HasSubstr("3 tags placed of 3 seen"), HasSubstr("joined"),
                          HasSubstr("1-sigma of a tag"), Not(HasSubstr("did not join"))));
}

TEST_F(MapBuildTest, RecordingsOfTwoDaysJoinInAnyOrder) {
  constexpr std::int64_t kDay_ns = 86'400'000'000'000;
  const std::string other = copy(2, "other_day");
  for (const char* table : {"imu0/data.csv", "tags0/data.csv", "tags0/frames.csv"})
    change_csv(other + "/mav0/" + table,
               each_row([](CsvRow& f) { f[0] = std::to_string(std::stoll(f[0]) + kDay_ns); }));
  for (const auto& order : {std::vector{robot(1), other}, std::vector{other, robot(1)}}) {
    build(order);
    EXPECT_LT(worst_error_m(), kMap_m);
    EXPECT_THAT(out_, Not(HasSubstr("did not join")));
  }
}

TEST_F(MapBuildTest, WrongTagSizeIsReportedAndCorrected) {
  build({robot(1), robot(2)}, {"--set", "tags.size_m=0.1632"});
  EXPECT_THAT(err_, AllOf(HasSubstr("all tags seem"), HasSubstr("% smaller")));
  EXPECT_LT(worst_error_m(), kMap_m);
  build({robot(1), robot(2)});
  EXPECT_THAT(err_, Not(HasSubstr("all tags seem")));
}

TEST_F(MapBuildTest, UnconnectedRecordingIsReportedWithARemedy) {
  const std::string elsewhere = copy_with_other_tags(2);
  build({robot(1), elsewhere});
  EXPECT_LT(worst_error_m(), kMap_m) << "the map is that of the first";
  EXPECT_THAT(out_, HasSubstr("did not join"));
  EXPECT_THAT(err_, AllOf(HasSubstr("tags 100, 101, 102 of " + elsewhere),
                          HasSubstr("Walk so that one tag is seen by both")));
}

TEST_F(MapBuildTest, WithoutTheReferenceTagTheStartIsTheOrigin) {
  build({copy_with_other_tags(1)});
  EXPECT_LT(worst_error_m(), kMap_m);
  EXPECT_THAT(err_, HasSubstr("no recording shows the reference tag 0"));
}

TEST_F(MapBuildTest, WithoutTagsNothingIsWritten) {
  const std::string blind = copy(1, "blind");
  folder_.write("blind/mav0/tags0/data.csv", "#t,id\n");
  change_csv(blind + "/mav0/tags0/frames.csv", each_row([](CsvRow& f) { f[1] = "0"; }));
  build({blind}, {}, kExitFailed);
  EXPECT_FALSE(fs::exists(file()));
  EXPECT_THAT(err_, AllOf(HasSubstr("blind"), HasSubstr("tag")));
  build({robot(1), blind});
  EXPECT_THAT(err_, HasSubstr("no tag was found in its"));
}

TEST_F(MapBuildTest, WithoutAnImuTheVerticalIsAGuess) {
  const std::string without_imu = folder_.file("slow");
  simulate(without_imu, "1", false);
  build({without_imu});
  EXPECT_LT(worst_error_m(), kMap_m);
  EXPECT_THAT(err_, HasSubstr("the vertical is a guess"));
  build({robot(1), without_imu});
  EXPECT_THAT(err_, Not(HasSubstr("guess"))) << "the other has an IMU";
}

TEST_F(MapBuildTest, RefusesRecordingsThatDoNotMatch) {
  const std::string other = copy(2, "other");
  replace(other + "/mav0/tags.yaml", "tag36h11", "tag25h9");
  build({robot(1), other}, {}, kExitFailed);
  EXPECT_THAT(err_, AllOf(HasSubstr("the family of the tags is tag25h9 here and tag36h11"),
                          HasSubstr("--set tags.family")));
  build({robot(1), robot(1)}, {}, kExitFailed);
  EXPECT_THAT(err_, HasSubstr("is given twice"));
}

TEST_F(MapBuildTest, GivenTagsAreFixed) {
  std::istringstream lines(content_of(robot(1) + "/truth/tags.csv"));
  std::string text;
  for (std::string line; std::getline(lines, line);)
    if (!line.starts_with("2,")) text += line + "\n";
  const std::string survey = folder_.write("survey.csv", text);
  build({robot(1)}, {"--map", survey});
  EXPECT_THAT(out_, HasSubstr("1 tags placed of 3 seen, 2 given"));
  EXPECT_LT(worst_error_m(), kMap_m);

  // A single one, without an IMU.
  const std::string without_imu = folder_.file("slow");
  simulate(without_imu, "1", false);
  replace(without_imu + "/mav0/tags.yaml", "reference_tag: 0", "reference_tag: 1");
  folder_.write("survey.csv", "id,size,px,py,pz,qw,qx,qy,qz\n1,0.16,3,4,5,0.8,0.6,0,0\n");
  build({without_imu}, {"--map", survey});
  EXPECT_LT(worst_error_m(), kMap_m) << "the given tag agrees with the others";

  build({robot(1)}, {"--map", robot(1) + "/truth/tags.csv"}, kExitFailed);
  EXPECT_THAT(err_, HasSubstr("beside those that were given"));
}

TEST_F(MapBuildTest, StoreGetsTheNextVersion) {
  const std::string store = folder_.file("hall.map");
  run({"map", "build", robot(1), "--store", store, "--comment", "monday"});
  run({"map", "build", robot(1), robot(2), "--store", store});
  EXPECT_THAT(out_, HasSubstr("version 2, 3 tags"));
  run({"map", "log", "--store", store});
  EXPECT_THAT(out_, AllOf(HasSubstr("monday"), HasSubstr("built from 2 recordings")));
  run({"map", "build", robot(1)}, kExitFailed);
  EXPECT_THAT(err_, HasSubstr("needs --out FILE or --store FILE"));
}

}  // namespace
}  // namespace fiducap
