#include "tools/command_line.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <sstream>
#include <vector>

#include <sys/wait.h>

#include "base/whole_file.hpp"
#include "support/temporary_folder.hpp"
#include "tools/live/live_verbs.hpp"

namespace fiducap {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Answer {
  int code{};
  std::string out;
  std::string err;
};

Answer say(std::vector<std::string> words) {
  std::vector<const char*> argv{"fiducap"};
  for (const std::string& word : words) argv.push_back(word.c_str());
  std::ostringstream out;
  std::ostringstream err;
  const int code = run_command_line(static_cast<int>(argv.size()), argv.data(), {out, err});
  return {code, out.str(), err.str()};
}

const std::vector<std::vector<std::string>> kVerbs{
    {"watch"},      {"import"},           {"check"},
    {"events"},     {"replay"},           {"evaluate"},
    {"map"},        {"map", "export"},    {"map", "import"},
    {"map", "log"}, {"map", "diff"},      {"map", "show"},
    {"tags"},       {"tags", "sheet"},    {"simulate"},
    {"cameras"},    {"capture"},          {"doctor"},
    {"control"},    {"control", "list"},  {"control", "rename"},
    {"calibrate"},  {"calibrate", "imu"}, {"calibrate", "extrinsics"}};

TEST(CommandLine, WhatCannotBeWrittenOutIsAFailure) {
  std::ostringstream out;
  out.setstate(std::ios::badbit);
  std::ostringstream err;
  const char* const argv[] = {"fiducap", "cameras", "--json"};
  EXPECT_EQ(run_command_line(3, argv, {out, err}), kExitFailed);
  EXPECT_THAT(err.str(), HasSubstr("is the disk full?"));
}

TEST(TagsSheet, WritesOverNoConfigurationOfAPerson) {
  const TemporaryFolder folder;
  const std::string mine = folder.write("robot.yaml", "bodies: []\n");
  Answer answer = say({"tags", "sheet", "--ids", "4", "--out", folder.file("robot.pdf")});
  EXPECT_EQ(answer.code, kExitFailed);
  EXPECT_THAT(answer.err, HasSubstr("it would be written over"));
  EXPECT_EQ(read_whole_file(mine), "bodies: []\n");
  answer = say({"tags", "sheet", "--ids", "4", "--out", folder.file("sheet.yaml")});
  EXPECT_THAT(answer.err, HasSubstr("must end in .pdf"));
  for (int again = 0; again < 2; ++again)
    EXPECT_EQ(say({"tags", "sheet", "--ids", "4", "--out", folder.file("my.pdf")}).code, kExitOk);
}

TEST(CommandLine, HelpOfEveryVerbTeachesWithAnExample) {
  for (auto words : kVerbs) {
    std::string verb = "fiducap";
    for (const std::string& word : words) verb += " " + word;
    words.push_back("--help");
    const Answer answer = say(words);
    EXPECT_EQ(answer.code, kExitOk) << verb;
    EXPECT_THAT(answer.out, AllOf(HasSubstr("Example:\n  " + verb.substr(0, verb.find(' ', 8))),
                                  HasSubstr(verb)))
        << verb;
    EXPECT_THAT(answer.err, IsEmpty()) << verb;
  }
}

TEST(CommandLine, WrongUsageEndsWithTwoAndPointsToHelp) {
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {},
           {"fly"},
           {"replay"},
           {"replay", "x"},
           {"replay", "x", "--out", "y", "--filter", "magic"},
           {"watch", "--duration", "x"},
           {"watch", "--duration", "-1"},
           {"watch", "--duration", "nan"},
           {"watch", "--server", "host:port"},
           {"map"},
           {"map", "log"},
           {"tags", "sheet", "--paper", "a9"},
           {"tags", "sheet", "--ids", "x", "--out", "/dev/null/x"},
           {"simulate", "--out", "x", "--images", "--corners"},
           {"simulate", "--out", "x", "--room", "moon"}}) {
    const Answer answer = say(words);
    EXPECT_EQ(answer.code, kExitUsage) << ::testing::PrintToString(words);
    EXPECT_FALSE(answer.err.empty()) << ::testing::PrintToString(words);
    EXPECT_THAT(answer.out, IsEmpty());
  }
}

TEST(CommandLine, AWrongWordIsAnsweredWithTheOneThatWasMeant) {
  const auto answer_to = [](const std::vector<std::string>& words) {
    const Answer answer = say(words);
    EXPECT_EQ(answer.code, kExitUsage) << ::testing::PrintToString(words);
    EXPECT_THAT(answer.out, IsEmpty());
    return answer.err;
  };
  EXPECT_EQ(answer_to({"replay", "x", "--ot", "y"}),
            "fiducap replay --ot: there is no such option; did you mean --out?\n");
  EXPECT_THAT(answer_to({"replay", "x", "--outt=y"}), HasSubstr("did you mean --out?"));
  EXPECT_THAT(answer_to({"map", "import", "--stoer", "y"}),
              HasSubstr("fiducap map import --stoer: there is no such option; did you mean "
                        "--store?"));
  EXPECT_THAT(answer_to({"tags", "sheet", "--magic"}),
              HasSubstr("`fiducap tags sheet --help` lists them"));
  EXPECT_THAT(answer_to({"--versoin"}), HasSubstr("did you mean --version?"));
  EXPECT_THAT(answer_to({"replya"}), HasSubstr("did you mean replay?"));
}

TEST(CommandLine, FailuresEndWithOneAndNameWhatIsWrong) {
  const TemporaryFolder folder;
  const auto expect_failure = [](const std::vector<std::string>& words, const std::string& what) {
    const Answer answer = say(words);
    EXPECT_EQ(answer.code, kExitFailed) << ::testing::PrintToString(words);
    EXPECT_THAT(answer.err, AllOf(HasSubstr("fiducap: "), HasSubstr(what)))
        << ::testing::PrintToString(words);
  };
  expect_failure({"replay", folder.file("none"), "--out", folder.file("out")}, "none");
  expect_failure({"evaluate", folder.file("none.tum"), folder.file("none")}, "none");
  expect_failure({"evaluate", folder.file("none.tum"), folder.file("none"), "--plot", "a.svg"},
                 "must end in .html");
  expect_failure({"map", "log", "--store", folder.file("none.map")}, "no such map store");
  expect_failure({"map", "import", "--store", folder.file("new.map"), folder.file("none.csv")},
                 "no such file");
  expect_failure({"tags", "sheet", "--size-mm", "900", "--out", folder.file("t.pdf")},
                 "does not fit");
}

TEST(CommandLine, TagSheetWritesThePdfAndItsStub) {
  const TemporaryFolder folder;
  const Answer answer =
      say({"tags", "sheet", "--ids", "4,5", "--size-mm", "80", "--out", folder.file("my.pdf")});
  EXPECT_EQ(answer.code, kExitOk) << answer.err;
  EXPECT_THAT(read_whole_file(folder.file("my.pdf")).value(), HasSubstr("id 5   tag36h11   80 mm"));
  EXPECT_THAT(read_whole_file(folder.file("my.yaml")).value(), HasSubstr("    5: 0.08\n"));
}

TEST(CommandLine, WatchFailsWhenNobodyAnswersAndSaysWhatToDo) {
  // Port 9 is "discard": nothing that speaks our protocol listens there.
  const Answer answer = say({"watch", "--server", "127.0.0.1:9", "--duration", "0.1"});
  EXPECT_EQ(answer.code, kExitFailed);
  EXPECT_THAT(answer.err, AllOf(HasSubstr("no Fiducap server answers at 127.0.0.1:9"),
                                HasSubstr("fiducapd --config"), HasSubstr("--server HOST:PORT")));
}

TEST(ServerAddress, ReadsHostAndPort) {
  const auto parsed = [](const char* text) {
    const auto address = parse_server_address(text, 21600);
    return address ? address->host + " " + std::to_string(address->port) : "none";
  };
  EXPECT_EQ(parsed("hall"), "hall 21600");
  EXPECT_EQ(parsed("10.0.0.7:99"), "10.0.0.7 99");
  EXPECT_EQ(parsed("[::1]:99"), "::1 99");
  EXPECT_EQ(parsed("[::1]"), "::1 21600");
  EXPECT_EQ(parsed("::1"), "::1 21600");
  for (const char* bad :
       {"", ":99", "hall:", "hall:0", "hall:65536", "hall:9x", "[::1", "[::1]x", "[]:9"})
    EXPECT_EQ(parsed(bad), "none") << bad;
}

// ---- The program itself.

Answer run(const std::string& arguments) {
  const std::string command =
      std::string(FIDUCAP_BINARY_DIR) + "/bin/fiducap " + arguments + " 2>&1";
  std::FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return {-1, "", "popen"};
  std::string out;
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) out += static_cast<char>(c);
  const int status = ::pclose(pipe);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, out, ""};
}

TEST(Program, EndsWithTheThreeExitCodes) {
  EXPECT_EQ(run("--help").code, 0);
  EXPECT_EQ(run("--version").code, 0);
  EXPECT_EQ(run("map log --store /nowhere/at/all").code, 1);
  EXPECT_EQ(run("nonsense").code, 2);
  EXPECT_EQ(run("").code, 2);
}

TEST(Program, WhatItWritesIsNotForEverybody) {
  namespace fs = std::filesystem;
  const TemporaryFolder folder;
  const std::string recording = folder.file("table");
  ASSERT_EQ(run("simulate --room table --seconds 1 --out " + recording).code, 0);
  const std::string store = folder.file("hall.map");
  ASSERT_EQ(run("map import --store " + store + " " + recording + "/truth/tags.csv").code, 0);
  for (const std::string& written : {store, recording + "/mav0/imu0/data.csv", recording})
    EXPECT_EQ(fs::status(written).permissions() & fs::perms::others_all, fs::perms::none)
        << written;
}

TEST(Program, HelpListsEveryVerb) {
  const Answer answer = run("--help");
  for (const char* verb : {"watch", "replay", "evaluate", "map", "tags", "simulate"})
    EXPECT_THAT(answer.out, HasSubstr(verb));
  EXPECT_THAT(answer.out, HasSubstr("Exit codes: 0 done, 1 failed, 2 wrong usage"));
}

}  // namespace
}  // namespace fiducap
