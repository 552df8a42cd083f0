// kill -9 at random instants of commit, refinement and migration: every version that was reported
// as stored exists and is whole. FIDUCAP_KILLS: their number instead of sixty.
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "mapping/store/map_store.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/map_fixture.hpp"
#include "unit/mapping/store/old_stores.hpp"

namespace fiducap {
namespace {

constexpr int kKills = 60;
constexpr double kOfCommits = 0.5;
constexpr double kOfRefinements = 0.25;
constexpr double kOfMigrations = 0.25;
// Short enough to hit the opening of the store as well.
constexpr int kLongestLife_us = 60'000;
// Every other writer runs until it has reported this many versions, on a machine of any speed.
constexpr int kMostVersions = 8;

int kills(double share) {
  const char* wanted = std::getenv("FIDUCAP_KILLS");
  return static_cast<int>(share * (wanted == nullptr ? kKills : std::max(4, std::atoi(wanted))));
}

/// A writer is killed a time after it has written a number of lines.
struct Life {
  int lines{};
  int then_us{};
};

/// Versions reported as stored, with their hashes; "-": not reported.
using Reported = std::map<std::int64_t, std::string>;

/// Starts the writer, lets it live, kills it.
Reported run_and_kill(std::vector<std::string> words, const Life& life) {
  int pipe_ends[2];
  EXPECT_EQ(pipe(pipe_ends), 0);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_addclose(&actions, pipe_ends[0]);
  std::string program = FIDUCAP_BINARY_DIR "/bin/map_store_writer";
  std::vector<char*> arguments{program.data()};
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t pid = 0;
  EXPECT_EQ(posix_spawn(&pid, program.c_str(), &actions, nullptr, arguments.data(), environ), 0);
  posix_spawn_file_actions_destroy(&actions);
  close(pipe_ends[1]);

  std::string output;
  char buffer[4096];
  while (std::count(output.begin(), output.end(), '\n') < life.lines) {
    const ssize_t n = read(pipe_ends[0], buffer, sizeof buffer);
    if (n <= 0) break;  // ended by itself: reported below
    output.append(buffer, static_cast<std::size_t>(n));
  }
  const timespec rest{0, 1000L * life.then_us};
  ppoll(nullptr, 0, &rest, nullptr);
  kill(pid, SIGKILL);
  int status = 0;
  waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status)) << "the writer ended by itself with status " << status;

  for (ssize_t n = 0; (n = read(pipe_ends[0], buffer, sizeof buffer)) > 0;)
    output.append(buffer, static_cast<std::size_t>(n));
  close(pipe_ends[0]);
  Reported stored;
  std::istringstream lines(output.substr(0, output.rfind('\n') + 1));
  std::int64_t version = 0;
  for (std::string hash; lines >> version >> hash;) stored[version] = hash;
  return stored;
}

/// All versions are whole, and all reported ones exist.
void expect_all(const MapStore& store, const Reported& reported) {
  const auto log = value_of(store.log());
  const std::int64_t newest = log.empty() ? 0 : log.front().version;
  EXPECT_GE(newest, reported.empty() ? 0 : reported.rbegin()->first);
  for (const auto& info : log) {
    const auto map = value_of(store.load(info.version));
    EXPECT_EQ(content_hash(map), info.hash);
    const auto found = reported.find(info.version);
    EXPECT_TRUE(found == reported.end() || found->second == "-" || found->second == info.hash)
        << "version " << info.version;
  }
}

class MapStoreKill : public testing::Test {
 protected:
  int draw(int most) { return std::uniform_int_distribution<int>(0, most)(random_); }
  /// Every other one at any instant, the others when they have stored something.
  Life draw_life(int turn, int longest_us) {
    if (turn % 2 == 0) return {0, draw(longest_us)};
    const int lines = 1 + draw(kMostVersions - 1);
    return {lines, draw(5000)};
  }
  /// One store after the other, each for some kills, so that its creation is hit too.
  void kill_repeatedly(const std::string& verb, int count, int longest_us) {
    Reported reported;
    std::string path;
    int with_versions = 0;
    for (int i = 0; i < count; ++i) {
      if (i % 6 == 0) {
        path = folder_.file(verb + std::to_string(i));
        reported.clear();
      }
      const Reported stored = run_and_kill({verb, path}, draw_life(i, longest_us));
      with_versions += stored.empty() ? 0 : 1;
      reported.insert(stored.begin(), stored.end());
      const auto store = value_of(MapStore::open(path));
      ASSERT_NO_FATAL_FAILURE(expect_all(store, reported));
      const auto map = store.newest();
      // A version is stored with its correlations.
      EXPECT_TRUE(map->version == 0 || (map->known && !map->known->pairs.empty()));
    }
    EXPECT_GE(with_versions, count / 2);
  }

  TemporaryFolder folder_;
  std::mt19937 random_{42};
};

TEST_F(MapStoreKill, EveryReportedVersionSurvives) {
  kill_repeatedly("commits", kills(kOfCommits), kLongestLife_us);
}

TEST_F(MapStoreKill, RefiningSessionLeavesWholeVersions) {
  // The first half second goes into the robots' motion.
  kill_repeatedly("refines", kills(kOfRefinements), 999'999);
}

/// A store of an old server. @return its versions
Reported write_old_store(const std::string& path, int schema) {
  constexpr int kVersions = 40;
  Reported written;
  {
    auto store = MapStore::open(path);
    EXPECT_TRUE(store);
    TagMap map = make_map(first_ids(100));
    for (int i = 0; i < kVersions; ++i) {
      map.tags.front().tag.X_WT.p.x() = i;
      map = store->commit(map, "of an old server").value();
      written[map.version] = map.hash;
    }
    EXPECT_TRUE(store->save_extrinsics({"robot", 0, Pose{}, StoredClock{0.02, 0.01}}));
  }
  EXPECT_TRUE(make_old(path, schema));
  return written;
}

/// Old or new schema, with all versions.
void expect_old_or_new(const std::string& path, int old_schema, const Reported& written) {
  {
    const auto file = value_of(SqliteFile::open(path, SqliteFile::Access::kSalvage));
    const auto schema = file.integer("PRAGMA user_version");
    ASSERT_TRUE(schema);
    EXPECT_TRUE(*schema == old_schema || *schema == kMapStoreSchema) << *schema;
    const auto reader = value_of(MapStore::open_to_read(path));
    ASSERT_NO_FATAL_FAILURE(expect_all(reader, written));
  }
  auto store = value_of(MapStore::open(path));
  ASSERT_NO_FATAL_FAILURE(expect_all(store, written));
  EXPECT_EQ(store.log()->size(), written.size());
  EXPECT_EQ(store.extrinsics()->front().clock->shift_s, 0.02);
  EXPECT_TRUE(store.commit(with_ties(*store.newest()), "afterwards"));
  EXPECT_NE(store.newest()->known, nullptr);
}

TEST_F(MapStoreKill, MigratedStoreIsOldOrNewAndWhole) {
  constexpr int kStores = 4;
  for (const OldSchema& old : kOldSchemas) {
    const std::string original = folder_.file("old" + std::to_string(old.number));
    const Reported written = write_old_store(original, old.number);
    const auto per_schema = static_cast<int>(kOldSchemas.size());
    for (int i = 0; i < kills(kOfMigrations) / per_schema; ++i) {
      std::vector<std::string> words{"migrates"};
      for (int k = 0; k < kStores; ++k) {
        words.push_back(folder_.file("migrates" + std::to_string(k)));
        for (const char* log : {"-wal", "-shm"}) std::filesystem::remove(words.back() + log);
        std::filesystem::copy_file(original, words.back(),
                                   std::filesystem::copy_options::overwrite_existing);
      }
      // Before the last one is open: one of them is being migrated.
      const Life life{draw(kStores - 1), draw(8'000)};
      (void)run_and_kill(words, life);
      for (std::size_t k = 1; k < words.size(); ++k)
        ASSERT_NO_FATAL_FAILURE(expect_old_or_new(words[k], old.number, written)) << i;
    }
  }
}

}  // namespace
}  // namespace fiducap
