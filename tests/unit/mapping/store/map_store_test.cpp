#include "mapping/store/map_store.hpp"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/whole_file.hpp"
#include "mapping/store/file_claim.hpp"
#include "mapping/store/sqlite_file.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

void write_bytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

class MapStoreTest : public testing::Test {
 protected:
  MapStore open() { return value_of(MapStore::open(path_)); }
  TagMap commit(const TagMap& map, const std::string& comment = {}) {
    return value_of(open().commit(map, comment));
  }
  void expect_refused(ErrorCode code, const std::string& text) {
    const auto before = value_of(read_whole_file(path_));
    const auto store = MapStore::open(path_);
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().code, code) << store.error().text();
    EXPECT_THAT(store.error().text(), HasSubstr(text));
    EXPECT_EQ(store.error().context, path_);
    EXPECT_EQ(value_of(read_whole_file(path_)), before) << "the refused file was changed";
  }

  TemporaryFolder folder_;
  std::string path_{folder_.file("hall.map")};
};

TEST_F(MapStoreTest, StartsEmpty) {
  auto store = open();
  ASSERT_TRUE(store.newest());
  EXPECT_EQ(store.newest()->version, 0);
  EXPECT_TRUE(store.newest()->tags.empty());
  EXPECT_TRUE(store.log()->empty());
  EXPECT_TRUE(store.extrinsics()->empty());
}

TEST_F(MapStoreTest, ReturnsACommittedMapExactly) {
  auto map = make_map({0, 5, 9});
  map.reference_tag = 5;
  map.family = "tag16h5";
  map.tags[1].state = TagState::kQuarantined;
  map.tags[2].component = 2;
  const auto stored = commit(map, "first light");
  EXPECT_EQ(stored.version, 1);
  EXPECT_EQ(stored.parent, 0);
  EXPECT_EQ(stored.hash, content_hash(map));
  const auto loaded = value_of(open().newest());
  EXPECT_EQ(loaded.version, 1);
  EXPECT_EQ(loaded.hash, stored.hash);
  EXPECT_EQ(content_hash(loaded), stored.hash);  // every number, bit for bit
  EXPECT_EQ(loaded.comment, "first light");
  EXPECT_EQ(loaded.created_utc_ns, map.created_utc_ns);
  EXPECT_EQ(loaded.reference_tag, 5);
  EXPECT_EQ(loaded.tags[1].state, TagState::kQuarantined);
  EXPECT_EQ(worst_corner_m(loaded, map), 0);
}

TEST_F(MapStoreTest, KeepsEveryVersion) {
  auto store = open();
  TagMap map = make_map({1});
  for (int i = 0; i < 5; ++i) {
    map.tags[0].tag.X_WT.p.x() = i;
    map = *store.commit(map, "step " + std::to_string(i));
  }
  const auto log = store.log();
  ASSERT_EQ(log->size(), 5u);
  EXPECT_EQ(log->front().version, 5);
  EXPECT_EQ(log->front().parent, 4);
  EXPECT_EQ(log->front().comment, "step 4");
  EXPECT_EQ(log->front().tags, 1);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(store.load(i + 1)->tags[0].tag.X_WT.p.x(), i);
}

TEST_F(MapStoreTest, MakesARollBackOfAnOldVersionCommittedAgain) {
  commit(make_map({1}));
  commit(make_map({1, 2}));
  auto store = open();
  const auto again = store.commit(*store.load(1), "back");
  EXPECT_EQ(again->version, 3);
  EXPECT_EQ(again->parent, 1);
  EXPECT_EQ(again->hash, store.log()->back().hash);
}

TEST_F(MapStoreTest, GivesAForeignMapNoParent) {
  auto foreign = make_map({1});
  foreign.version = 17;
  EXPECT_EQ(commit(foreign).parent, 0);
}

TEST_F(MapStoreTest, IsBackedUpWhileAServerWrites) {
  auto server = open();
  value_of(server.claim());
  const auto first = value_of(server.commit(make_map({1, 2}), "first"));
  StoredExtrinsics camera;
  camera.body = "drone";
  value_of(server.save_extrinsics(camera));
  // A commit under way: its version is not there yet.
  auto writing = value_of(SqliteFile::open(path_));
  value_of(writing.execute("BEGIN IMMEDIATE; UPDATE version SET comment = 'half'"));
  const std::string copy = folder_.file("copy.map");
  const MapBackup backup = value_of(MapStore::back_up(path_, copy));
  EXPECT_EQ(backup.versions, 1u);
  EXPECT_EQ(backup.newest, 1);
  value_of(writing.execute("COMMIT"));
  EXPECT_EQ(value_of(server.commit(make_map({1, 2, 3}), "second")).version, 2);
  EXPECT_EQ(std::filesystem::status(copy).permissions(),
            std::filesystem::status(path_).permissions());
  // Restored: the copy in the place of the store.
  path_ = copy;
  EXPECT_EQ(value_of(open().newest()).hash, first.hash);
  EXPECT_EQ(value_of(open().log()).front().comment, "first");
  EXPECT_EQ(value_of(open().extrinsics()).size(), 1u);
  EXPECT_EQ(value_of(open().commit(make_map({4}), "later")).version, 2);
}

TEST_F(MapStoreTest, FailedBackupLeavesTheEarlierOne) {
  commit(make_map({1}));
  const std::string copy = folder_.file("copy.map");
  value_of(MapStore::back_up(path_, copy));
  const auto before = value_of(read_whole_file(copy));
  EXPECT_FALSE(MapStore::back_up(folder_.file("none.map"), copy));
  write_bytes(folder_.file("other.map"), "no store");
  EXPECT_FALSE(MapStore::back_up(folder_.file("other.map"), copy));
  EXPECT_FALSE(MapStore::back_up(path_, folder_.file("none/copy.map")));
  EXPECT_EQ(value_of(read_whole_file(copy)), before);
  std::size_t files = 0;
  for (const auto& one : std::filesystem::directory_iterator(folder_.text()))
    files += one.path().string().find(".part") != std::string::npos ? 1 : 0;
  EXPECT_EQ(files, 0u) << "no temporary file stays";
}

TEST_F(MapStoreTest, RunsNothingThatAFileDefines) {
  for (const char* sql : {"CREATE TRIGGER t AFTER INSERT ON tag BEGIN DELETE FROM tag; END",
                          "CREATE VIEW v AS SELECT * FROM tag",
                          "ALTER TABLE tag ADD COLUMN big BLOB AS (zeroblob(50000000))"}) {
    std::filesystem::remove(path_);
    commit(make_map({1}));
    value_of(value_of(SqliteFile::open(path_)).execute(sql));
    expect_refused(ErrorCode::kInvalid, "which no map store has");
    EXPECT_FALSE(MapStore::open_to_read(path_));
    EXPECT_FALSE(MapStore::back_up(path_, folder_.file("copy.map")));
  }
}

TEST_F(MapStoreTest, NamesAMissingVersion) {
  const auto missing = open().load(3);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_NE(missing.error().context.find("version 3"), std::string::npos);
}

TEST_F(MapStoreTest, RefusesAnInvalidMap) {
  auto store = open();
  auto map = make_map({1, 2});
  map.tags[1].tag.X_WT.p.x() = std::numeric_limits<double>::quiet_NaN();
  const auto refused = store.commit(map, "");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalid);
  EXPECT_NE(refused.error().what.find("tag 2: position must be finite"), std::string::npos);
  EXPECT_TRUE(store.log()->empty());
}

TEST_F(MapStoreTest, KeepsTheNewestExtrinsicsOfEachCamera) {
  {
    auto store = open();
    ASSERT_TRUE(store.save_extrinsics({"beta", 0, Pose{}, {}, {.focal = 0.1}}));
    ASSERT_TRUE(store.save_extrinsics({"alpha",
                                       1,
                                       Pose{exp_so3({1, 2, 3}), {0.1, 0.2, 0.3}},
                                       StoredClock{-0.012, 0.02},
                                       {.focal = 0.012, .k1 = -0.03}}));
    ASSERT_TRUE(
        store.save_extrinsics({"beta", 0, Pose{Eigen::Quaterniond::Identity(), {7, 8, 9}}}));
  }
  const auto all = open().extrinsics();
  ASSERT_EQ(all->size(), 2u);
  EXPECT_EQ((*all)[0].body, "alpha");
  EXPECT_EQ((*all)[0].camera, 1);
  EXPECT_EQ((*all)[0].X_BV.q.coeffs(), exp_so3({1, 2, 3}).coeffs());
  EXPECT_EQ((*all)[1].X_BV.p, Eigen::Vector3d(7, 8, 9));
  ASSERT_TRUE((*all)[0].clock);
  EXPECT_EQ((*all)[0].clock->shift_s, -0.012);
  EXPECT_EQ((*all)[0].clock->readout_s, 0.02);
  EXPECT_FALSE((*all)[1].clock);
  EXPECT_EQ((*all)[0].lens.focal, 0.012);
  EXPECT_EQ((*all)[0].lens.centre_u_px, std::nullopt);
  EXPECT_EQ((*all)[0].lens.k1, -0.03);
  EXPECT_TRUE((*all)[1].lens.is_none());
}

TEST_F(MapStoreTest, RefusesASecondWriter) {
  auto store = open();
  auto other = SqliteFile::open(path_);
  ASSERT_TRUE(other->execute("BEGIN IMMEDIATE"));
  const auto refused = store.commit(make_map({1}), "");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(refused.error().text().find("another process is writing"), std::string::npos)
      << refused.error().text();
}

TEST_F(MapStoreTest, RefusesGarbage) {
  write_bytes(path_, std::string(5000, 'x'));
  expect_refused(ErrorCode::kInvalid, "is damaged or not a map store");
  write_bytes(path_, "x");
  expect_refused(ErrorCode::kInvalid, "move it away");
}

TEST_F(MapStoreTest, RefusesOtherDatabases) {
  {
    auto file = SqliteFile::open(path_);
    ASSERT_TRUE(file->execute("CREATE TABLE t (a); INSERT INTO t VALUES (1)"));
  }
  expect_refused(ErrorCode::kUnsupported, "database of another program");
}

TEST_F(MapStoreTest, RefusesANewerSchema) {
  commit(make_map({1}));
  const std::string next = std::to_string(kMapStoreSchema + 1);
  ASSERT_TRUE(SqliteFile::open(path_)->execute(("PRAGMA user_version = " + next).c_str()));
  expect_refused(ErrorCode::kUnsupported, "newer Fiducap (schema " + next +
                                              ", this one knows up to " +
                                              std::to_string(kMapStoreSchema) + ")");
}

TEST_F(MapStoreTest, RefusesATruncatedFile) {
  commit(make_map(first_ids(20)));
  const auto whole = value_of(read_whole_file(path_));
  ASSERT_GT(whole.size(), 8192u);
  for (const std::size_t left :
       {std::size_t{1}, std::size_t{50}, std::size_t{100}, std::size_t{4095}, std::size_t{4096},
        whole.size() / 2, whole.size() - 4096, whole.size() - 1}) {
    SCOPED_TRACE(left);
    write_bytes(path_, whole.substr(0, left));
    expect_refused(ErrorCode::kInvalid, "move it away");
  }
}

TEST_F(MapStoreTest, NoticesDamagedBytes) {
  const auto map = make_map({1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
  const auto hash = commit(map).hash;
  const auto whole = value_of(read_whole_file(path_));
  int noticed = 0;
  for (std::size_t at = 0; at < whole.size(); at += 97) {
    auto damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x41);
    write_bytes(path_, damaged);
    const auto store = MapStore::open(path_);
    const auto loaded = store ? store->load(1) : Expected<TagMap>(tl::unexpected(store.error()));
    if (!loaded) {
      ++noticed;
      EXPECT_FALSE(loaded.error().text().empty());
    } else {
      EXPECT_EQ(content_hash(*loaded), hash) << "byte " << at;
    }
  }
  EXPECT_GT(noticed, 5);
}

TEST_F(MapStoreTest, NamesAMissingFolder) {
  EXPECT_THAT(error_of(MapStore::open(folder_.file("nowhere/hall.map"))),
              HasSubstr("the folder must exist"));
  EXPECT_FALSE(MapStore::open(""));
  EXPECT_FALSE(MapStore::open(":memory:"));
}

void damage(const std::string& path, int version) {
  const std::string sql = "UPDATE tag SET px = 77 WHERE version = " + std::to_string(version);
  ASSERT_TRUE(SqliteFile::open(path)->execute(sql.c_str()));
}

TEST_F(MapStoreTest, FindsTheNewestSoundVersion) {
  for (int i = 0; i < 4; ++i) commit(make_map({1, 2}));
  damage(path_, 4);
  damage(path_, 3);
  auto store = open();
  EXPECT_FALSE(store.newest());
  const auto sound = value_of(store.newest_sound());
  EXPECT_EQ(sound.map.version, 2);
  ASSERT_EQ(sound.damaged.size(), 2u);
  EXPECT_EQ(sound.damaged.front().version, 4);
  EXPECT_NE(sound.damaged.front().fault.find("its content has hash"), std::string::npos);
  const auto next = value_of(store.commit(sound.map, "after the damage"));
  EXPECT_EQ(next.version, 5) << "damaged versions are kept";
  EXPECT_EQ(next.parent, 2);
  EXPECT_EQ(store.log()->size(), 5u);
}

TEST_F(MapStoreTest, ReportsWhenNoVersionIsSound) {
  commit(make_map({1}));
  damage(path_, 1);
  EXPECT_THAT(error_of(open().newest_sound()), HasSubstr("every one of its 1 versions"));
}

TEST_F(MapStoreTest, ReadsADamagedFileReadOnly) {
  for (int i = 0; i < 20; ++i) commit(make_map({1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
  const auto whole = value_of(read_whole_file(path_));
  write_bytes(path_, whole.substr(0, whole.size() - 4096));
  ASSERT_FALSE(MapStore::open(path_));
  const auto store = value_of(MapStore::open_to_read(path_));
  EXPECT_EQ(store.load(1)->tags.size(), 10u);
  EXPECT_EQ(value_of(read_whole_file(path_)).size(), whole.size() - 4096);
  EXPECT_FALSE(MapStore::open_to_read(folder_.file("nothing")));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("nothing")));
}

class FileClaimTest : public MapStoreTest {};

TEST_F(FileClaimTest, RefusesASecondServer) {
  auto first = MapStore::open(path_);
  ASSERT_TRUE(first && first->claim());
  auto second = MapStore::open(path_);
  ASSERT_TRUE(second) << "reading needs no claim";
  EXPECT_THAT(error_of(second->claim()),
              testing::HasSubstr("process " + std::to_string(::getpid())));
  *first = std::move(*MapStore::open(folder_.file("other.map")));
  EXPECT_TRUE(second->claim()) << "released";
  std::filesystem::create_symlink(path_, folder_.file("link.map"));
  EXPECT_FALSE(value_of(MapStore::open(folder_.file("link.map"))).claim()) << "the same file";
  ASSERT_TRUE(FileClaim::holder(path_));
  EXPECT_EQ(*FileClaim::holder(path_), "process " + std::to_string(::getpid()));
  EXPECT_FALSE(FileClaim::holder(folder_.file("unclaimed")));
}

TEST_F(FileClaimTest, EndsWithAKilledServer) {
  ASSERT_TRUE(MapStore::open(path_));
  const pid_t child = ::fork();
  if (child == 0) {
    const auto claim = FileClaim::take(path_);
    ::kill(::getpid(), claim ? SIGKILL : SIGTERM);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(WTERMSIG(status), SIGKILL);
  ASSERT_TRUE(std::filesystem::exists(path_ + ".lock"));
  EXPECT_FALSE(FileClaim::holder(path_));
  EXPECT_TRUE(MapStore::open(path_)->claim());
}

}  // namespace
}  // namespace fiducap
