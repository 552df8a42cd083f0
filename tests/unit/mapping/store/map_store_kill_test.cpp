// kill -9 at random instants: every version that was reported as stored is there, whole.
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <random>
#include <sstream>
#include <string>

#include "mapping/store/map_store.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

constexpr int kKills = 36;
// Short enough to hit the opening of the store as well.
constexpr int kLongestLife_ms = 60;
// Every other writer is let go on until it has said this many versions, however slow the machine
// is.
constexpr int kMostVersions = 8;

/// When a writer is killed: so long after it has said so many lines.
struct Life {
  int lines{};
  int then_ms{};
};

/// Starts the writer, lets it live, kills it. @return what it reported as stored.
std::map<std::int64_t, std::string> run_and_kill(const std::string& store, const Life& life) {
  int pipe_ends[2];
  EXPECT_EQ(pipe(pipe_ends), 0);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_addclose(&actions, pipe_ends[0]);
  std::string program = FIDUCAP_BINARY_DIR "/bin/map_store_writer";
  std::string path = store;
  char* arguments[] = {program.data(), path.data(), nullptr};
  pid_t pid = 0;
  EXPECT_EQ(posix_spawn(&pid, program.c_str(), &actions, nullptr, arguments, environ), 0);
  posix_spawn_file_actions_destroy(&actions);
  close(pipe_ends[1]);

  std::string said;
  char buffer[4096];
  while (std::count(said.begin(), said.end(), '\n') < life.lines) {
    const ssize_t n = read(pipe_ends[0], buffer, sizeof buffer);
    if (n <= 0) break;  // ended by itself: judged below
    said.append(buffer, static_cast<std::size_t>(n));
  }
  pollfd nothing{-1, 0, 0};
  poll(&nothing, 1, life.then_ms);
  kill(pid, SIGKILL);
  int status = 0;
  waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status)) << "the writer ended by itself with status " << status;

  for (ssize_t n = 0; (n = read(pipe_ends[0], buffer, sizeof buffer)) > 0;)
    said.append(buffer, static_cast<std::size_t>(n));
  close(pipe_ends[0]);
  std::map<std::int64_t, std::string> stored;
  std::istringstream lines(said.substr(0, said.rfind('\n') + 1));
  std::int64_t version = 0;
  for (std::string hash; lines >> version >> hash;) stored[version] = hash;
  return stored;
}

void expect_all(const std::string& path, const std::map<std::int64_t, std::string>& reported) {
  const auto store = MapStore::open(path);
  ASSERT_TRUE(store) << store.error().text();
  const auto log = store->log();
  ASSERT_TRUE(log) << log.error().text();
  // At most the version being written may be beyond what was reported.
  const std::int64_t newest = reported.empty() ? 0 : reported.rbegin()->first;
  EXPECT_GE(static_cast<std::int64_t>(log->size()), newest);
  for (const auto& info : *log) {
    const auto map = store->load(info.version);
    ASSERT_TRUE(map) << map.error().text();
    EXPECT_EQ(content_hash(*map), info.hash);
    const auto told = reported.find(info.version);
    EXPECT_TRUE(told == reported.end() || told->second == info.hash) << "version " << info.version;
  }
}

TEST(MapStoreKill, EveryReportedVersionSurvives) {
  TemporaryFolder folder;
  std::mt19937 random(42);
  std::map<std::int64_t, std::string> reported;
  std::string path;
  std::size_t kills_with_versions = 0;
  for (int i = 0; i < kKills; ++i) {
    if (i % 6 == 0) {  // a fresh store, so that its creation is hit too
      path = folder.file("store" + std::to_string(i));
      reported.clear();
    }
    const auto draw = [&](int most) { return std::uniform_int_distribution<int>(0, most)(random); };
    const Life life =
        i % 2 == 0 ? Life{0, draw(kLongestLife_ms)} : Life{1 + draw(kMostVersions - 1), draw(5)};
    const auto stored = run_and_kill(path, life);
    kills_with_versions += stored.empty() ? 0 : 1;
    reported.insert(stored.begin(), stored.end());
    expect_all(path, reported);
  }
  EXPECT_GE(kills_with_versions, static_cast<std::size_t>(kKills / 2));
}

}  // namespace
}  // namespace fiducap
