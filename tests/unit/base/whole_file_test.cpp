#include "base/whole_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;

TEST(WholeFile, ReadsBackWhatWasWrittenIntoAMissingFolder) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a/b/text");
  ASSERT_TRUE(write_whole_file(path, "one"));
  ASSERT_TRUE(write_whole_file(path, "two\nlines"));
  EXPECT_EQ(read_whole_file(path).value(), "two\nlines");
  const auto entries =
      std::distance(fs::directory_iterator(folder.file("a/b")), fs::directory_iterator());
  EXPECT_EQ(entries, 1) << "a part was left behind";
}

TEST(WholeFile, NeitherFollowsNorFillsWhatOthersPutBesideIt) {
  const TemporaryFolder folder;
  const std::string path = folder.file("robot.token");
  ASSERT_TRUE(write_whole_file(folder.file("precious"), "precious"));
  fs::create_symlink(folder.file("precious"), path + ".part" + std::to_string(::getpid()));
  ASSERT_TRUE(write_whole_file(path, "secret", 0600));
  EXPECT_EQ(read_whole_file(folder.file("precious")).value(), "precious");
  EXPECT_FALSE(fs::is_symlink(path));
  EXPECT_EQ(fs::status(path).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST(WholeFile, ReportsWhyItCannotWrite) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_whole_file(folder.file("plain"), "x"));
  const auto written = write_whole_file(folder.file("plain/below"), "y");
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kUnavailable);
}

TEST(WholeFile, RefusesMissingAndOversizedFiles) {
  const TemporaryFolder folder;
  EXPECT_EQ(read_whole_file(folder.file("none")).error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(write_whole_file(folder.file("ten"), "0123456789"));
  EXPECT_EQ(read_whole_file(folder.file("ten"), 9).error().code, ErrorCode::kUnsupported);
  EXPECT_TRUE(read_whole_file(folder.file("ten"), 10));
}

}  // namespace
}  // namespace fiducap
