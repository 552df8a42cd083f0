#include "mapping/store/map_repair.hpp"

#include <gmock/gmock.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "base/whole_file.hpp"
#include "mapping/store/sqlite_file.hpp"
#include "support/fault_disk.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kVersions = 30;
constexpr std::size_t kPage = 4096;

class MapRepairTest : public testing::Test {
 protected:
  MapRepairTest() {
    auto store = MapStore::open(path_);
    TagMap map = make_map(first_ids(24));
    for (int i = 0; i < kVersions; ++i) {
      map.tags[0].tag.X_WT.p.x() = i;
      map = *store->commit(map, "step " + std::to_string(i + 1));
      hashes_.push_back(map.hash);
    }
    EXPECT_TRUE(store->save_extrinsics({"robot", 0, Pose{}}));
  }
  void execute(const char* sql) { value_of(value_of(SqliteFile::open(path_)).execute(sql)); }
  /// Damages tag 5 of a version.
  void damage(int version) {
    execute(("UPDATE tag SET px = 77 WHERE tag_id = 5 AND version = " + std::to_string(version))
                .c_str());
  }
  /// The store opens with committed versions only. @return their numbers
  std::vector<std::int64_t> expect_sound() {
    std::vector<std::int64_t> there;
    const auto store = MapStore::open(path_);
    EXPECT_TRUE(store) << store.error().text();
    if (!store) return there;
    const auto versions = store->log();
    for (const auto& one : *versions) {
      const auto map = store->load(one.version);
      EXPECT_TRUE(map) << map.error().text();
      if (map) {
        EXPECT_EQ(map->hash, hashes_.at(static_cast<std::size_t>(one.version - 1)));
      }
      there.insert(there.begin(), one.version);
    }
    return there;
  }

  TemporaryFolder folder_;
  std::string path_{folder_.file("hall.map")};
  std::vector<std::string> hashes_;
};

TEST_F(MapRepairTest, KeepsASoundStore) {
  const auto before = value_of(read_whole_file(path_));
  const auto repaired = value_of(repair_map_store(path_));
  EXPECT_TRUE(repaired.found.is_sound());
  EXPECT_THAT(repaired.kept_as, IsEmpty());
  EXPECT_EQ(repaired.found.sound.size(), std::size_t{kVersions});
  EXPECT_TRUE(value_of(read_whole_file(path_)) == before);
}

TEST_F(MapRepairTest, OmitsADamagedVersionAndKeepsTheMode) {
  ASSERT_EQ(::chmod(path_.c_str(), 0660), 0);
  damage(30);
  ASSERT_FALSE(check_map_store(path_)->is_sound());
  const auto repaired = value_of(repair_map_store(path_));
  EXPECT_THAT(repaired.found.sentences(), ElementsAre(HasSubstr("version 30: is damaged")));
  EXPECT_EQ(repaired.kept_as, path_ + ".damaged-1");
  EXPECT_EQ(expect_sound().size(), std::size_t{kVersions - 1});
  EXPECT_EQ(MapStore::open(path_)->newest()->version, 29);
  EXPECT_EQ(MapStore::open(path_)->extrinsics()->size(), 1u);
  EXPECT_EQ(check_map_store(repaired.kept_as)->damaged.size(), 1u) << "the damaged file is kept";
  EXPECT_TRUE(check_map_store(path_)->is_sound());
  struct stat now {};
  ASSERT_EQ(::stat(path_.c_str(), &now), 0);
  EXPECT_EQ(now.st_mode & 07777, 0660u);
}

TEST_F(MapRepairTest, LinksChildrenOfALostVersionToItsParent) {
  damage(12);
  ASSERT_TRUE(repair_map_store(path_));
  EXPECT_EQ(MapStore::open(path_)->load(13)->parent, 11);
}

TEST_F(MapRepairTest, RepairsOrRefusesEveryDestroyedPage) {
  const std::string whole = value_of(read_whole_file(path_));
  test::FaultDisk disk;  // quicker than a real one
  std::size_t repaired_ones = 0;
  for (std::size_t page = 1; page < whole.size() / kPage; ++page) {
    SCOPED_TRACE(page);
    std::string bytes = whole;
    for (std::size_t i = 0; i < kPage; ++i) bytes[page * kPage + i] = static_cast<char>(0x5a ^ i);
    path_ = "part" + std::to_string(page);
    disk.set_content("damaged", bytes);
    const auto found = salvage_map_store("damaged", path_);
    EXPECT_TRUE(disk.content("damaged") == bytes);
    if (!found) {
      EXPECT_THAT(found.error().text(), HasSubstr("it was not changed"));
      continue;
    }
    EXPECT_EQ(expect_sound(), found->sound);
    if (found->is_sound()) continue;  // a page without content
    ++repaired_ones;
    EXPECT_FALSE(found->sentences().empty());
  }
  EXPECT_GT(repaired_ones, whole.size() / kPage / 2);
}

TEST_F(MapRepairTest, RepairsATruncatedFile) {
  const std::string whole = value_of(read_whole_file(path_));
  std::ofstream(path_, std::ios::binary | std::ios::trunc)
      << whole.substr(0, whole.size() / 2 + 100);
  ASSERT_FALSE(MapStore::open(path_));
  (void)value_of(repair_map_store(path_));
  const auto there = expect_sound();
  EXPECT_GT(there.size(), 5u);
  EXPECT_LT(there.size(), std::size_t{kVersions});
}

TEST_F(MapRepairTest, RefusesOtherFiles) {
  const std::string other = folder_.write("other", std::string(9000, 'x'));
  EXPECT_FALSE(repair_map_store(other));
  EXPECT_EQ(value_of(read_whole_file(other)), std::string(9000, 'x'));
  EXPECT_FALSE(fs::exists(other + ".damaged-1"));
  {
    auto file = SqliteFile::open(folder_.file("db"));
    ASSERT_TRUE(file->execute("CREATE TABLE t (a)"));
  }
  const auto refused = repair_map_store(folder_.file("db"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUnsupported);
  EXPECT_FALSE(repair_map_store(folder_.file("nothing")));
  EXPECT_FALSE(fs::exists(folder_.file("nothing")));
}

TEST_F(MapRepairTest, RefusesAStoreInUse) {
  auto store = MapStore::open(path_);
  ASSERT_TRUE(store->claim());
  EXPECT_THAT(error_of(repair_map_store(path_)), HasSubstr("is in use by process"));
}

TEST_F(MapRepairTest, KeepsEarlierDamagedFiles) {
  folder_.write("hall.map.damaged-1", "precious");
  damage(30);
  EXPECT_EQ(repair_map_store(path_)->kept_as, path_ + ".damaged-2");
  EXPECT_EQ(value_of(read_whole_file(path_ + ".damaged-1")), "precious");
}

/// For the rest of this process, as SystemCallFilter=~@chown of the service.
void forbid_chown() {
  std::vector<sock_filter> program{BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
  for (const auto call : {SYS_chown, SYS_fchown, SYS_lchown, SYS_fchownat}) {
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 1));
    program.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM));
  }
  program.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
      ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) != 0)
    std::_Exit(77);
}

TEST_F(MapRepairTest, WorksWithoutChown) {
  fs::resize_file(path_, fs::file_size(path_) - kPage);
  EXPECT_EXIT(
      {
        forbid_chown();
        const auto repaired = repair_map_store(path_);
        std::fputs(repaired ? "repaired" : repaired.error().text().c_str(), stderr);
        std::_Exit(repaired ? 0 : 1);
      },
      testing::ExitedWithCode(0), "repaired");
  EXPECT_TRUE(MapStore::open(path_));
}

TEST_F(MapRepairTest, FinishesAnInterruptedRepair) {
  damage(30);
  const std::string log = folder_.write("a log", "of the damaged store");
  for (int steps_done = 0; steps_done < 4; ++steps_done) {
    SCOPED_TRACE(steps_done);
    const std::string path = folder_.file("interrupted" + std::to_string(steps_done));
    fs::copy_file(path_, path);
    fs::copy_file(log, path + "-wal");
    ASSERT_TRUE(salvage_map_store(path_, repaired_name(path)));
    if (steps_done >= 1) fs::create_hard_link(path, path + ".damaged-1");
    if (steps_done >= 2) fs::create_hard_link(path + "-wal", path + ".damaged-1-wal");
    if (steps_done >= 3) fs::remove(path + "-wal");
    EXPECT_THAT(error_of(MapStore::open(path)), HasSubstr("finishes it"));
    const auto repaired = value_of(repair_map_store(path));
    EXPECT_EQ(repaired.kept_as, path + ".damaged-1");
    EXPECT_EQ(value_of(read_whole_file(path + ".damaged-1-wal")), "of the damaged store");
    EXPECT_FALSE(fs::exists(path + ".damaged-2"));
    EXPECT_FALSE(fs::exists(repaired_name(path)));
    EXPECT_EQ(MapStore::open(path)->newest_sound()->map.version, 29);
    EXPECT_TRUE(MapStore::open(path)->newest_sound()->damaged.empty());
  }
}

}  // namespace
}  // namespace fiducap
