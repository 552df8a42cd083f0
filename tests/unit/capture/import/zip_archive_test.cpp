#include "capture/import/input_file.hpp"

#include <gmock/gmock.h>

#include <fstream>

#include "support/log_files.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

class ZipArchiveTest : public testing::Test {
 protected:
  std::string archive(const std::string& bytes) const { return folder_.write("a.zip", bytes); }
  std::string content_of(const std::string& name) const {
    std::ifstream file(folder_.file(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  const std::string long_text_ = std::string(700'000, 'x') + "end";
  TemporaryFolder folder_;
};

TEST_F(ZipArchiveTest, StoredAndDeflatedFilesComeBack) {
  auto zip = ZipArchive::open(archive(
      test::zip_file({{"walk/a.csv", long_text_, true}, {"walk/b.mp4", long_text_, false}})));
  ASSERT_TRUE(zip) << zip.error().text();
  ASSERT_EQ(zip->entries().size(), 2u);
  EXPECT_EQ(zip->entries()[0].name, "walk/a.csv");
  for (const ZipEntry& entry : zip->entries()) {
    const auto unpacked = zip->unpack(entry, folder_.file("out"));
    ASSERT_TRUE(unpacked) << unpacked.error().text();
    EXPECT_EQ(content_of("out"), long_text_);
  }
}

TEST_F(ZipArchiveTest, SizesMayStandWhereThoseBeyond4GBDo) {
  auto zip = ZipArchive::open(
      archive(test::zip_file({{"a", long_text_, true, true}, {"empty", "", true, true}})));
  ASSERT_TRUE(zip) << zip.error().text();
  ASSERT_EQ(zip->entries()[0].bytes, long_text_.size());
  for (const ZipEntry& entry : zip->entries()) {
    const auto unpacked = zip->unpack(entry, folder_.file(entry.name));
    ASSERT_TRUE(unpacked) << unpacked.error().text();
  }
  EXPECT_EQ(content_of("a"), long_text_);
}

TEST_F(ZipArchiveTest, ACommentBehindTheDirectoryIsPassedOver) {
  std::string bytes = test::zip_file({{"a", "content"}});
  bytes[bytes.size() - 2] = 5;
  auto zip = ZipArchive::open(archive(bytes + "PK\x05\x06!"));
  ASSERT_TRUE(zip) << zip.error().text();
  EXPECT_EQ(zip->entries().size(), 1u);
}

TEST_F(ZipArchiveTest, EveryCutArchiveIsAnError) {
  const std::string bytes = test::zip_file({{"a", "some content"}, {"b", "more"}});
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_FALSE(ZipArchive::open(archive(bytes.substr(0, n)))) << n;
}

TEST_F(ZipArchiveTest, MoreThanTheDirectorySaysIsNotUnpacked) {
  std::string bytes = test::zip_file({{"a", long_text_}});
  bytes[bytes.rfind("PK\x01\x02") + 24] = 1;  // its size, lowest byte
  auto zip = ZipArchive::open(archive(bytes));
  ASSERT_TRUE(zip);
  const auto unpacked = zip->unpack(zip->entries()[0], folder_.file("out"));
  ASSERT_FALSE(unpacked);
  EXPECT_THAT(unpacked.error().what, HasSubstr("unpacks to more than its stated size"));
}

TEST_F(ZipArchiveTest, AnArchiveThatUnpacksToFarMoreThanItIsLongIsRefused) {
  std::string bytes = test::zip_file({{"a", long_text_}});
  bytes[bytes.rfind("PK\x01\x02") + 27] = 0x70;  // 1.75 GiB
  auto zip = ZipArchive::open(archive(bytes));
  ASSERT_TRUE(zip);
  const auto unpacked = zip->unpack(zip->entries()[0], folder_.file("out"));
  ASSERT_FALSE(unpacked);
  EXPECT_THAT(unpacked.error().what, HasSubstr("far more than its own size"));
}

TEST_F(ZipArchiveTest, DamageIsSeen) {
  std::string bytes = test::zip_file({{"a", "some content", false}});
  bytes[bytes.find("content")] ^= 1;
  auto zip = ZipArchive::open(archive(bytes));
  ASSERT_TRUE(zip);
  EXPECT_FALSE(zip->unpack(zip->entries()[0], folder_.file("out")));
}

}  // namespace
}  // namespace fiducap
