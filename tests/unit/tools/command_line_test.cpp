#include "tools/command_line.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "support/command_run.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/live/live_verbs.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::PrintToString;
using testing::SizeIs;

using Words = std::vector<std::string>;

TEST(CommandLine, FailedOutputIsAFailure) {
  std::ostringstream out, err;
  out.setstate(std::ios::badbit);
  const char* const argv[] = {"fiducap", "cameras", "--json"};
  EXPECT_EQ(run_command_line(3, argv, {out, err}), kExitFailed);
  EXPECT_THAT(err.str(), HasSubstr("is the disk full?"));
}

TEST(PrintableOutput, PassesNoControlCharacterOfAText) {
  std::ostringstream terminal;
  PrintableOutput output(terminal);
  std::ostream out(&output);
  out << "a\tGröße\x1b]0;name\x07" << '\n'
      << "\xe6\x97" << '\xa5' << "\x9b"
      << "2J\u009b";
  draw(out, "\x1b[K");
  out << "\xc3" << std::flush;
  EXPECT_EQ(terminal.str(), "a\tGröße\\x1b]0;name\\x07\n日\\x9b2J\\xc2\\x9b\x1b[K\\xc3");
}

TEST(TagsSheet, OverwritesNoConfiguration) {
  const TemporaryFolder folder;
  const std::string mine = folder.write("robot.yaml", "bodies: []\n");
  const auto sheet = [&](const std::string& name) {
    return run_fiducap({"tags", "sheet", "--ids", "4", "--out", folder.file(name)});
  };
  EXPECT_EQ(sheet("robot.pdf").code, kExitFailed);
  EXPECT_THAT(sheet("robot.pdf").err, HasSubstr("it would be written over"));
  EXPECT_EQ(content_of(mine), "bodies: []\n");
  EXPECT_THAT(sheet("sheet.yaml").err, HasSubstr("must end in .pdf"));
  for (int again = 0; again < 2; ++again) EXPECT_EQ(sheet("my.pdf").code, kExitOk);
}

TEST(CommandLine, HelpOfEveryVerbHasAnExample) {
  const auto all = run_fiducap({"--help"});
  for (Words words :
       std::vector<Words>{{"watch"},      {"import"},           {"check"},
                          {"events"},     {"replay"},           {"evaluate"},
                          {"map"},        {"map", "export"},    {"map", "import"},
                          {"map", "log"}, {"map", "diff"},      {"map", "show"},
                          {"tags"},       {"tags", "sheet"},    {"simulate"},
                          {"cameras"},    {"capture"},          {"doctor"},
                          {"control"},    {"control", "list"},  {"control", "rename"},
                          {"calibrate"},  {"calibrate", "imu"}, {"calibrate", "extrinsics"}}) {
    std::string verb = "fiducap";
    for (const std::string& word : words) verb += " " + word;
    SCOPED_TRACE(verb);
    words.push_back("--help");
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, kExitOk);
    EXPECT_THAT(run.out, AllOf(HasSubstr("Example:\n  " + verb.substr(0, verb.find(' ', 8))),
                               HasSubstr(verb), Not(HasSubstr("{false}"))));
    EXPECT_THAT(run.err, IsEmpty());
    EXPECT_THAT(all.out, HasSubstr(words.front()));
  }
  EXPECT_THAT(all.out, HasSubstr("Exit codes: 0 done, 1 failed, 2 wrong usage"));
}

TEST(CommandLine, WrongUsageEndsWithTwo) {
  for (const Words& words :
       std::vector<Words>{{},
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
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, kExitUsage) << PrintToString(words);
    EXPECT_FALSE(run.err.empty()) << PrintToString(words);
    EXPECT_THAT(run.out, IsEmpty());
  }
}

TEST(CommandLine, SuggestsTheClosestWord) {
  const std::pair<Words, const char*> kCases[]{
      {{"replay", "x", "--ot", "y"},
       "fiducap replay --ot: there is no such option; did you mean --out?\n"},
      {{"map", "import", "--stoer", "y"},
       "fiducap map import --stoer: there is no such option; did you mean --store?"},
      {{"tags", "sheet", "--magic"}, "`fiducap tags sheet --help` lists them"},
      {{"--versoin"}, "did you mean --version?"},
      {{"replya"}, "did you mean replay?"}};
  for (const auto& [words, expected] : kCases) {
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, kExitUsage) << PrintToString(words);
    EXPECT_THAT(run.out, IsEmpty());
    EXPECT_THAT(run.err, HasSubstr(expected));
  }
  EXPECT_EQ(run_fiducap(kCases[0].first).err, kCases[0].second) << "nothing else";
}

TEST(CommandLine, FailureEndsWithOneAndItsReason) {
  const TemporaryFolder folder;
  const std::pair<Words, const char*> kCases[]{
      {{"replay", folder.file("none"), "--out", folder.file("out")}, "none"},
      {{"evaluate", folder.file("none.tum"), folder.file("none")}, "none"},
      {{"evaluate", folder.file("none.tum"), folder.file("none"), "--plot", "a.svg"},
       "must end in .html"},
      {{"map", "log", "--store", folder.file("none.map")}, "no such map store"},
      {{"map", "import", "--store", folder.file("new.map"), folder.file("none.csv")},
       "no such file"},
      {{"tags", "sheet", "--size-mm", "900", "--out", folder.file("t.pdf")}, "does not fit"}};
  for (const auto& [words, reason] : kCases) {
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, kExitFailed) << PrintToString(words);
    EXPECT_THAT(run.err, AllOf(HasSubstr("fiducap: "), HasSubstr(reason)));
  }
}

TEST(CommandLine, WatchWithoutAServerFailsWithARemedy) {
  // Port 9 is "discard": nothing there uses our protocol.
  const auto run = run_fiducap({"watch", "--server", "127.0.0.1:9", "--duration", "0.1"});
  EXPECT_EQ(run.code, kExitFailed);
  EXPECT_THAT(run.err, AllOf(HasSubstr("no Fiducap server answers at 127.0.0.1:9"),
                             HasSubstr("fiducapd --config"), HasSubstr("--server HOST:PORT")));
}

TEST(ServerAddress, HasHostAndPort) {
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

/// The program itself. @return its exit code
int run_program(const std::string& arguments) {
  const std::string program = FIDUCAP_BINARY_DIR "/bin/fiducap ";
  const int status = std::system((program + arguments + " >/dev/null 2>&1").c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(Program, EndsWithTheThreeExitCodes) {
  EXPECT_EQ(run_program("--version"), 0);
  EXPECT_EQ(run_program("map log --store /nowhere/at/all"), 1);
  EXPECT_EQ(run_program("nonsense"), 2);
  EXPECT_EQ(run_program(""), 2);
}

TEST(Program, FilesAreNotReadableByOtherUsers) {
  namespace fs = std::filesystem;
  const TemporaryFolder folder;
  const std::string recording = folder.file("table");
  ASSERT_EQ(run_program("simulate --room table --seconds 1 --out " + recording), 0);
  const std::string store = folder.file("hall.map");
  ASSERT_EQ(run_program("map import --store " + store + " " + recording + "/truth/tags.csv"), 0);
  for (const std::string& written : {store, recording + "/mav0/imu0/data.csv", recording})
    EXPECT_EQ(fs::status(written).permissions() & fs::perms::others_all, fs::perms::none)
        << written;
}

/// Scripts read stdout: with --json it is one JSON value and nothing else, with any exit code.
class JsonOutput : public ::testing::Test {
 protected:
  /// @return stdout; discarded when it was not one JSON value
  nlohmann::json run(std::vector<std::string> words, int exit_code = kExitOk) {
    words.emplace_back("--json");
    const auto run = run_fiducap(words);
    EXPECT_EQ(run.code, exit_code) << ::testing::PrintToString(words) << run.err;
    err_ = run.err;
    auto json = nlohmann::json::parse(run.out, nullptr, false);
    EXPECT_FALSE(json.is_discarded()) << ::testing::PrintToString(words) << run.out;
    return json;
  }

  TemporaryFolder folder_;
  std::string err_;
};

TEST_F(JsonOutput, OfRecordingsRunsAndEvaluations) {
  const std::string recording = folder_.file("table");
  const auto made = run({"simulate", "--room", "table", "--seconds", "8", "--out", recording});
  EXPECT_GT(made["frames"], 100);
  EXPECT_EQ(made["recording"], recording);
  const auto checked = run({"check", recording});
  EXPECT_EQ(checked["recordings"][0]["usable"], true);
  EXPECT_THAT(checked["recordings"][0]["streams"], SizeIs(3));
  const std::string out = folder_.file("out");
  const auto replayed = run({"replay", recording, "--out", out});
  EXPECT_THAT(err_, IsEmpty()) << "without a terminal there is no progress to show";
  EXPECT_EQ(replayed["body"], "table");
  EXPECT_THAT(content_of(out + "/plots.html"), HasSubstr("table over time"));
  const std::string plot = folder_.file("e.html");
  const auto evaluated = run({"evaluate", out + "/table.tum", recording, "--plot", plot});
  EXPECT_THAT(err_, IsEmpty());
  EXPECT_GT(evaluated["pose"]["samples"], 20);
  EXPECT_THAT(content_of(plot), HasSubstr("Position error against truth"));
  run({"replay", recording, "--no-plots", "--out", out});
  EXPECT_FALSE(std::filesystem::exists(out + "/plots.html"));
}

TEST_F(JsonOutput, OfFailures) {
  const auto checked = run({"check", folder_.file("none")}, kExitFailed);
  EXPECT_EQ(checked["recordings"][0]["usable"], false);
  EXPECT_THAT(err_, HasSubstr("none"));
  const auto found = run({"doctor", "--server", "127.0.0.1:9"}, kExitFailed);
  EXPECT_GT(found["faults"], 0);
  EXPECT_EQ(found["sections"][0]["title"], "Network");
}

TEST_F(JsonOutput, OfATagSheet) {
  const auto sheet =
      run({"tags", "sheet", "--ids", "4,5", "--size-mm", "80", "--out", folder_.file("t.pdf")});
  EXPECT_EQ(sheet["ids"], (std::vector<int>{4, 5}));
  EXPECT_EQ(sheet["yaml"], folder_.file("t.yaml"));
  EXPECT_THAT(content_of(folder_.file("t.pdf")), HasSubstr("id 5   tag36h11   80 mm"));
  EXPECT_THAT(content_of(folder_.file("t.yaml")), HasSubstr("    5: 0.08\n"));
}

TEST_F(JsonOutput, OfMapVerbs) {
  const std::string csv = folder_.write("tags.csv",
                                        "id,size,px,py,pz,qw,qx,qy,qz\n1,0.16,0,0,0,1,0,0,0\n"
                                        "2,0.16,1,0,0,1,0,0,0\n3,0.16,0,1,0,1,0,0,0\n");
  const std::string survey = folder_.write("m.csv", "id,x,y,z\n1,5,0,0\n2,6,0,0\n3,5,1,0\n");
  const auto map = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "map");
    words.insert(words.end(), {"--store", folder_.file("hall.map")});
    return run(std::move(words));
  };
  const auto imported = map({"import", csv});
  EXPECT_EQ(imported["version"], 1);
  EXPECT_EQ(imported["tags"], 3);
  EXPECT_EQ(map({"edit", "--quarantine", "3"})["version"], 2);
  EXPECT_EQ(map({"rollback", "1"})["version"], 3);
  EXPECT_EQ(map({"name", "3", "as it was"})["comment"], "as it was");
  const auto aligned = map({"align", "--to", survey});
  EXPECT_EQ(aligned["version"], 4);
  EXPECT_THAT(aligned["residuals"], SizeIs(3));
  EXPECT_NEAR(map({"align", "--distance", "1", "2", "1.01"})["tape_less_map_m"], 0.01, 1e-6);
  EXPECT_EQ(map({"export", folder_.file("out.yaml")})["version"], 4);
  EXPECT_EQ(map({"check"})["sound"], true);
  EXPECT_EQ(map({"repair"})["kept_as"], "");
  EXPECT_THAT(map({"log"}), SizeIs(4));
  EXPECT_EQ(map({"show"})["version"], 4);
  EXPECT_EQ(map({"diff"})["after"], 4);
}

}  // namespace
}  // namespace fiducap
