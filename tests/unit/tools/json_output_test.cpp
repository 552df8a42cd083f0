// Scripts read stdout: with --json it is one JSON value and nothing else, whatever the exit code.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "support/temporary_folder.hpp"
#include "tools/command_line.hpp"
#include "tools/terminal.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class JsonOutput : public ::testing::Test {
 protected:
  /// @return what stood on stdout; discarded when it was not one JSON value
  nlohmann::json say(std::vector<std::string> words, int exit_code = kExitOk) {
    words.emplace_back("--json");
    std::vector<const char*> argv{"fiducap"};
    for (const std::string& word : words) argv.push_back(word.c_str());
    std::ostringstream out;
    std::ostringstream err;
    EXPECT_EQ(run_command_line(static_cast<int>(argv.size()), argv.data(), {out, err}), exit_code)
        << ::testing::PrintToString(words) << err.str();
    err_ = err.str();
    auto json = nlohmann::json::parse(out.str(), nullptr, false);
    EXPECT_FALSE(json.is_discarded()) << ::testing::PrintToString(words) << out.str();
    return json;
  }

  TemporaryFolder folder_;
  std::string err_;
};

TEST_F(JsonOutput, OfRecordingsRunsAndTheirEvaluation) {
  const std::string recording = folder_.file("table");
  const auto made = say({"simulate", "--room", "table", "--seconds", "8", "--out", recording});
  EXPECT_GT(made["frames"], 100);
  EXPECT_EQ(made["recording"], recording);
  const auto checked = say({"check", recording});
  EXPECT_EQ(checked["recordings"][0]["usable"], true);
  EXPECT_THAT(checked["recordings"][0]["streams"], ::testing::SizeIs(3));
  const std::string out = folder_.file("out");
  const auto run = say({"replay", recording, "--out", out});
  EXPECT_THAT(err_, IsEmpty()) << "nobody sits at a terminal: there is no progress to show";
  EXPECT_EQ(run["body"], "table");
  EXPECT_THAT(read_whole_file(out + "/plots.html").value(), HasSubstr("table over time"));
  const auto evaluated =
      say({"evaluate", out + "/table.tum", recording, "--plot", folder_.file("e.html")});
  EXPECT_THAT(err_, IsEmpty());
  EXPECT_GT(evaluated["pose"]["samples"], 20);
  EXPECT_THAT(read_whole_file(folder_.file("e.html")).value(),
              HasSubstr("Position error against truth"));
  say({"replay", recording, "--no-plots", "--out", out});
  EXPECT_FALSE(read_whole_file(out + "/plots.html"));
}

TEST_F(JsonOutput, OfARecordingThatIsNotThere) {
  const auto checked = say({"check", folder_.file("none")}, kExitFailed);
  EXPECT_EQ(checked["recordings"][0]["usable"], false);
  EXPECT_THAT(err_, HasSubstr("none"));
}

TEST_F(JsonOutput, OfASheetOfTags) {
  const auto sheet =
      say({"tags", "sheet", "--ids", "4,5", "--size-mm", "80", "--out", folder_.file("t.pdf")});
  EXPECT_EQ(sheet["ids"], (std::vector<int>{4, 5}));
  EXPECT_EQ(sheet["yaml"], folder_.file("t.yaml"));
}

TEST_F(JsonOutput, OfEverythingDoneToAMap) {
  const std::string csv = folder_.file("tags.csv");
  ASSERT_TRUE(write_whole_file(csv,
                               "id,size,px,py,pz,qw,qx,qy,qz\n1,0.16,0,0,0,1,0,0,0\n"
                               "2,0.16,1,0,0,1,0,0,0\n3,0.16,0,1,0,1,0,0,0\n"));
  const std::string store = folder_.file("hall.map");
  const std::vector<std::string> at{"--store", store};
  const auto map = [&](std::vector<std::string> words, int exit_code = kExitOk) {
    words.insert(words.begin(), "map");
    words.insert(words.end(), at.begin(), at.end());
    return say(std::move(words), exit_code);
  };
  const auto imported = map({"import", csv});
  EXPECT_EQ(imported["version"], 1);
  EXPECT_EQ(imported["tags"], 3);
  EXPECT_EQ(map({"edit", "--quarantine", "3"})["version"], 2);
  EXPECT_EQ(map({"rollback", "1"})["version"], 3);
  EXPECT_EQ(map({"name", "3", "as it was"})["comment"], "as it was");
  ASSERT_TRUE(write_whole_file(folder_.file("m.csv"), "id,x,y,z\n1,5,0,0\n2,6,0,0\n3,5,1,0\n"));
  const auto aligned = map({"align", "--to", folder_.file("m.csv")});
  EXPECT_EQ(aligned["version"], 4);
  EXPECT_THAT(aligned["residuals"], ::testing::SizeIs(3));
  EXPECT_NEAR(map({"align", "--distance", "1", "2", "1.01"})["tape_less_map_m"], 0.01, 1e-6);
  EXPECT_EQ(map({"export", folder_.file("out.yaml")})["version"], 4);
  EXPECT_EQ(map({"check"})["sound"], true);
  EXPECT_EQ(map({"repair"})["kept_as"], "");
  EXPECT_THAT(map({"log"}), ::testing::SizeIs(4));
  EXPECT_EQ(map({"show"})["version"], 4);
  EXPECT_EQ(map({"diff"})["after"], 4);
}

TEST_F(JsonOutput, OfTheDoctorWhenNoServerAnswers) {
  const auto found = say({"doctor", "--server", "127.0.0.1:9"}, kExitFailed);
  EXPECT_GT(found["faults"], 0);
  EXPECT_EQ(found["sections"][0]["title"], "Network");
}

}  // namespace
}  // namespace fiducap
