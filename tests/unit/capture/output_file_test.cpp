#include "capture/output_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

std::string content_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(OutputFile, IsOnDiskAfterAFlushAndCountsItsBytes) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a/b/file");
  auto file = OutputFile::create(path);
  ASSERT_TRUE(file) << file.error().text();
  ASSERT_TRUE(file->write("one\n"));
  EXPECT_EQ(content_of(path), "");
  ASSERT_TRUE(file->flush());
  EXPECT_EQ(content_of(path), "one\n");
  EXPECT_EQ(file->bytes(), 4u);
  ASSERT_TRUE(file->write(std::string(200'000, 'x')));
  EXPECT_EQ(content_of(path).size(), 200'004u) << "the buffer is small";
  ASSERT_TRUE(file->write("end"));
  ASSERT_TRUE(file->close());
  EXPECT_EQ(content_of(path).size(), 200'007u);
  EXPECT_EQ(file->bytes(), 200'007u);
}

TEST(OutputFile, SaysWhyTheDiskRefusedAndTakesNothingAfterIt) {
  auto file = OutputFile::create("/dev/full");
  ASSERT_TRUE(file);
  ASSERT_TRUE(file->write("one")) << "still in the buffer";
  const auto flushed = file->flush();
  ASSERT_FALSE(flushed);
  EXPECT_THAT(flushed.error().text(), HasSubstr("/dev/full: cannot be written: No space left"));
  EXPECT_FALSE(file->write("two"));
  EXPECT_FALSE(file->close());
  EXPECT_FALSE(file->close()) << "the failure stays";
  EXPECT_EQ(file->bytes(), 0u);
}

TEST(OutputFile, NamesTheFolderThatCannotBeMade) {
  const TemporaryFolder folder;
  const auto file = OutputFile::create(folder.write("file", "") + "/below/name");
  ASSERT_FALSE(file);
  EXPECT_THAT(file.error().text(), HasSubstr("Not a directory"));
}

}  // namespace
}  // namespace fiducap
