// Recordings of the whole server on full and stuck disks, and when it is killed.
#include <gmock/gmock.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <future>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/whole_file.hpp"
#include "fiducap/control.hpp"
#include "mapping/store/map_store.hpp"
#include "support/command_run.hpp"
#include "support/fault_disk.hpp"
#include "support/fiducapd_process.hpp"
#include "support/frozen_file.hpp"
#include "support/new_log.hpp"
#include "support/running_server.hpp"
#include "support/temporary_folder.hpp"
#include "tools/replay/replay_verbs.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::MatchesRegex;

constexpr const char* kOperatorToken = "correct horse";
constexpr std::size_t kDisk_bytes = 150'000;  // a second or two of one robot's IMU

/// The operator's command line.
class Operator final {
 public:
  explicit Operator(std::uint16_t port) {
    options_.port = port;
    options_.token = kOperatorToken;
  }
  int record(const std::string& name) { return run({"record", name}); }
  int stop(double timeout_s = 30) { return run({"stop", "--patience", std::to_string(timeout_s)}); }
  int list() { return run({"list"}); }
  [[nodiscard]] std::string output() const { return last_.out + last_.err; }
  [[nodiscard]] const std::string& printed() const { return last_.out; }
  /// The newest recording; empty: the server does not answer.
  Recording newest() {
    ControlState state;
    if (!Control(options_).list(state) || state.recordings.empty()) return {};
    return state.recordings.back();
  }
  bool server_answers() {
    ControlState state;
    return static_cast<bool>(Control(options_).list(state));
  }

 private:
  int run(std::vector<std::string> words) {
    words.insert(words.begin(), "control");
    words.insert(words.end(), {"--server", "127.0.0.1:" + std::to_string(options_.port), "--token",
                               kOperatorToken});
    last_ = run_fiducap(words);
    return last_.code;
  }
  ControlOptions options_;
  CommandRun last_;
};

class RecorderTest : public testing::Test {
 protected:
  RecorderTest() {
    auto arguments = corners_on_free_ports();
    arguments.insert(arguments.begin(), {"--config", demo_file()});
    for (const std::string& set :
         {"streaming.native.port=" + std::to_string(port_), "operator.token_file=" + token_file(),
          "recorder.folder=" + folder_.file("recordings")})
      arguments.insert(arguments.end(), {"--set", set});
    server_.emplace(arguments);
  }
  [[nodiscard]] std::string token_file() const {
    const std::string file = folder_.write("token", kOperatorToken);
    std::filesystem::permissions(file, std::filesystem::perms::owner_read);
    return file;
  }
  [[nodiscard]] bool is_up() {
    return wait_until([&] { return operator_.server_answers(); });
  }
  void allow_files_of(rlim_t bytes) const {
    const rlimit limit{bytes, RLIM_INFINITY};
    ASSERT_EQ(::prlimit(server_->pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
  }

  TemporaryFolder folder_;
  std::uint16_t port_ = free_port();
  std::optional<FiducapdProcess> server_;
  Operator operator_{port_};
};

TEST_F(RecorderTest, StopReportsTheSavedData) {
  ASSERT_TRUE(is_up()) << server_->output();
  ASSERT_EQ(operator_.record("flight"), 0) << operator_.output();
  EXPECT_THAT(operator_.output(), HasSubstr("recording \"flight\""));
  ASSERT_TRUE(wait_until([&] { return operator_.newest().samples > 0; }));
  ASSERT_EQ(operator_.stop(), 0) << operator_.output();
  EXPECT_THAT(operator_.printed(),
              MatchesRegex("the recording has ended: [1-9][0-9]* samples, [0-9.]+ .B; "
                           "0 dropped\n"));
  EXPECT_EQ(operator_.newest().state, RecordingState::kFinished);
}

TEST_F(RecorderTest, FullDiskIsReportedAndTheNextRecordingWorks) {
  ASSERT_TRUE(is_up()) << server_->output();
  allow_files_of(kDisk_bytes);
  ASSERT_EQ(operator_.record("full"), 0) << operator_.output();
  ASSERT_TRUE(wait_until([&] { return operator_.newest().state == RecordingState::kFailed; }));
  EXPECT_EQ(operator_.list(), 0);
  EXPECT_THAT(operator_.output(), HasSubstr("recording \"full\" failed: "));
  EXPECT_EQ(operator_.stop(), 1);
  EXPECT_THAT(operator_.output(), HasSubstr("File too large"));
  EXPECT_THAT(operator_.output(), MatchesRegex("(.|\n)*[1-9][0-9]* bytes saved(.|\n)*"));
  EXPECT_THAT(server_->output(), HasSubstr("recorder: the recording \"full\" has failed: "));

  EXPECT_EQ(operator_.record("full"), 1) << "the name is taken";
  EXPECT_THAT(operator_.output(), HasSubstr("nothing is overwritten"));
  allow_files_of(RLIM_INFINITY);
  ASSERT_EQ(operator_.record("room again"), 0) << operator_.output();
  EXPECT_EQ(operator_.stop(), 0) << operator_.output();
}

/// The newest stamp in each stream of a session, by file.
std::map<std::string, std::int64_t> newest_stamps(const std::filesystem::path& session) {
  std::map<std::string, std::int64_t> newest;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(session)) {
    const std::string name = std::filesystem::relative(entry.path(), session).string();
    if (entry.path().extension() != ".csv" || name.find("truth/") != std::string::npos) continue;
    if (name == "refinements.csv") continue;  // counts turns, has no stamps
    std::ifstream file(entry.path());
    std::int64_t& stamp = newest[name];
    const bool turns = name == "turns.csv";
    for (std::string line; std::getline(file, line);) {
      if (line.empty() || line.front() == '#' || file.eof()) continue;  // header; cut line
      for (int before = 0; turns && before < 2; ++before) line.erase(0, line.find(',') + 1);
      stamp = std::stoll(line);
    }
  }
  return newest;
}

TEST_F(RecorderTest, KilledServerLosesASecondAtMost) {
  // Files are flushed together, a second apart; images come to the recorder a little late.
  constexpr std::int64_t kApart_ns = 1'500'000'000;
  constexpr std::int64_t kRecorded_ns = 3'500'000'000;
  ASSERT_TRUE(is_up()) << server_->output();
  ASSERT_EQ(operator_.record("killed"), 0) << operator_.output();
  const std::filesystem::path session = folder_.file("recordings/killed");
  const std::string imu = "drone/mav0/imu0/data.csv";
  std::int64_t first = 0;
  ASSERT_TRUE(wait_until([&] {
    const std::int64_t now = newest_stamps(session)[imu];
    if (first == 0) first = now;
    return now - first > kRecorded_ns;
  }));
  server_->signal(SIGKILL);
  server_->exit_code();
  const auto stamps = newest_stamps(session);
  EXPECT_GE(stamps.size(), 3u * 4 + 1) << "imu, corners, frames, truth of three robots; turns";
  for (const auto& [name, stamp] : stamps) EXPECT_LT(stamps.at(imu) - stamp, kApart_ns) << name;
}

bool has(const NewLog& log, const char* text) { return log.text().find(text) != std::string::npos; }

TEST(RecorderOnAStuckDisk, LetsTheServerContinueAndStoreItsMap) {
  const TemporaryFolder folder;
  const NewLog log;
  ServerConfig config = corner_demo();
  config.operators.token = kOperatorToken;
  config.recorder.folder = folder.file("recordings");
  config.recorder.at_start = "flight";
  config.map.store = folder.file("map.sqlite");
  config.map.builder.commit_period_s = 3600;  // only at the end
  std::optional<FrozenFile> frozen;
  RunningServer server(config, {}, [&] {
    frozen.emplace(folder.file("recordings/flight/drone/mav0/tags0/frames.csv"));
  });
  // Otherwise the server could not be destroyed.
  const std::shared_ptr<void> thaw(nullptr, [&](void*) { frozen->thaw(); });
  Operator person(server->ports().native);
  const Client client(server.client_options());
  Frame frame;
  ASSERT_TRUE(wait_until([&] { return client.latest(frame) && has(log, "joined the map"); }))
      << "frames are sent, and tags are mapped";
  EXPECT_EQ(person.stop(0.2), 1) << person.output();
  EXPECT_THAT(person.output(), HasSubstr("its disk has taken nothing for 0.2 s"));
  EXPECT_EQ(person.record("next"), 1) << person.output();
  EXPECT_THAT(person.output(), HasSubstr("\"next\" has not begun"));
  EXPECT_EQ(person.list(), 0);
  EXPECT_THAT(person.output(), HasSubstr("recording \"flight\" stopping"));
  const std::uint64_t seen = frame.number;
  EXPECT_TRUE(wait_until([&] { return client.latest(frame) && frame.number > seen + 100; }));

  server.stop();
  EXPECT_FALSE(server.clean()) << "a thread is left behind";
  EXPECT_FALSE(value_of(value_of(MapStore::open(config.map.store)).newest()).tags.empty());
}

TEST(RecorderWithoutADisk, LetsTheServerStart) {
  const TemporaryFolder folder;
  const NewLog log;
  ServerConfig config = corner_demo();
  config.operators.token = kOperatorToken;
  config.recorder.folder = folder.write("no_folder", "a file");
  config.recorder.at_start = "flight";
  RunningServer server(config);
  Operator person(server->ports().native);
  EXPECT_EQ(person.list(), 0);
  EXPECT_THAT(person.output(), HasSubstr("recording \"flight\" failed"));
  EXPECT_TRUE(has(log, "the recording \"flight\" has failed"));
  server.stop();
  EXPECT_TRUE(server.clean());
}

TEST(MapOnAStuckDisk, DelaysTheEndBySecondsOnly) {
  test::FaultDisk disk;
  ServerConfig config = corner_demo();
  config.map.store = "map.sqlite";
  config.map.builder.commit_period_s = 3600;  // only at the end
  std::promise<void> repaired;
  const NewLog log;
  RunningServer server(config);
  ASSERT_TRUE(wait_until([&] { return has(log, "joined the map"); }));
  disk.on_sync([wait = repaired.get_future().share()] { wait.wait(); });
  // Otherwise the server could not be destroyed.
  const std::shared_ptr<void> repair(nullptr, [&](void*) { repaired.set_value(); });
  server.stop();
  EXPECT_FALSE(server.clean());
  EXPECT_TRUE(has(log, "the disk of the map is stuck"));
}

class RefinedSessionTest : public testing::Test {
 protected:
  /// Three robots in real time until the map has adopted this number of solutions.
  void serve_and_record(int refinements) {
    ServerConfig config = corner_demo();
    config.map.builder.refine_period_s = 0.5;
    config.recorder.folder = folder_.file("recordings");
    config.recorder.at_start = "session";
    RunningServer server(config);
    ASSERT_TRUE(wait_until([&] { return adopted() >= refinements; }));
    server.stop();
    ASSERT_TRUE(server.clean());
  }
  /// Solutions on disk.
  [[nodiscard]] int adopted() const {
    const auto turns = read_refinement_turns(session() + "/refinements.csv");
    return turns ? static_cast<int>(std::count_if(turns->begin(), turns->end(),
                                                  [](const auto& t) { return t.adopted; }))
                 : 0;
  }
  /// @return the replay's report about the live estimates
  nlohmann::json replay() {
    ReplayArguments arguments;
    arguments.recordings = {session()};
    arguments.out = folder_.file("out");
    std::ostringstream out;
    std::ostringstream err;
    EXPECT_EQ(run_replay(arguments, {out, err}), 0) << err.str();
    const auto report = read_whole_file(folder_.file("out/report.json"));
    return report ? nlohmann::json::parse(*report)["live"] : nlohmann::json{};
  }
  [[nodiscard]] std::string session() const { return folder_.file("recordings/session"); }

  TemporaryFolder folder_;
};

TEST_F(RefinedSessionTest, IsReplayedBitwise) {
  serve_and_record(5);
  auto live = replay();
  EXPECT_EQ(live["turns_missed"], 0);
  EXPECT_GT(live["compared"], 100);
  EXPECT_EQ(live["different"], 0) << live;

  // Counter-check: without the refinements it is another session.
  std::ofstream(session() + "/refinements.csv") << "#taken_after,adopted_after\n";
  live = replay();
  EXPECT_GT(live["different"], 100) << live;
}

}  // namespace
}  // namespace fiducap
