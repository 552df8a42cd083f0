#include "mapping/store/file_claim.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "mapping/store/map_store.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

class FileClaimTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string path_{folder_.file("hall.map")};
};

TEST_F(FileClaimTest, TwoServersDoNotShareAStore) {
  auto first = MapStore::open(path_);
  ASSERT_TRUE(first && first->claim());
  auto second = MapStore::open(path_);
  ASSERT_TRUE(second) << "reading is everybody's";
  const auto refused = second->claim();
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("process " + std::to_string(::getpid())),
            std::string::npos);
  *first = std::move(*MapStore::open(folder_.file("other.map")));
  EXPECT_TRUE(second->claim()) << "given back";
}

TEST_F(FileClaimTest, AStoreHasOneLockWhateverItIsCalled) {
  auto first = MapStore::open(path_);
  ASSERT_TRUE(first && first->claim());
  std::filesystem::create_symlink(path_, folder_.file("link.map"));
  auto second = MapStore::open(folder_.file("link.map"));
  ASSERT_TRUE(second);
  EXPECT_FALSE(second->claim());
  ASSERT_TRUE(FileClaim::holder(path_));
  EXPECT_EQ(*FileClaim::holder(path_), "process " + std::to_string(::getpid()));
  EXPECT_FALSE(FileClaim::holder(folder_.file("nobody's")));
}

TEST_F(FileClaimTest, AKilledServerLeavesNoLock) {
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
