#include "capture/import/input_file.hpp"

#include <gmock/gmock.h>

#include "support/log_files.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

class ZipArchiveTest : public testing::Test {
 protected:
  ZipArchive open(const std::string& bytes) const {
    return value_of(ZipArchive::open(folder_.write("a.zip", bytes)));
  }
  /// Of the first file.
  std::string error_of_unpacking(const std::string& bytes) const {
    auto zip = open(bytes);
    return error_of(zip.unpack(zip.entries()[0], folder_.file("out")));
  }
  /// `long_text_` in an archive with one byte of its size replaced.
  std::string with_size_byte(std::size_t at, char value) const {
    std::string bytes = test::zip_file({{"a", long_text_}});
    bytes[bytes.rfind("PK\x01\x02") + at] = value;
    return bytes;
  }
  const std::string long_text_ = std::string(700'000, 'x') + "end";
  TemporaryFolder folder_;
};

TEST_F(ZipArchiveTest, ReadsSizesOfZip64) {
  auto zip = open(test::zip_file({{"a", long_text_, true, true}, {"empty", "", true, true}}));
  ASSERT_EQ(zip.entries()[0].bytes, long_text_.size());
  for (const ZipEntry& entry : zip.entries())
    EXPECT_EQ(error_of(zip.unpack(entry, folder_.file(entry.name))), "no error");
  EXPECT_EQ(content_of(folder_.file("a")), long_text_);
}

TEST_F(ZipArchiveTest, SkipsACommentBehindTheDirectory) {
  std::string bytes = test::zip_file({{"a", "content"}});
  bytes[bytes.size() - 2] = 5;
  EXPECT_EQ(open(bytes + "PK\x05\x06!").entries().size(), 1u);
}

TEST_F(ZipArchiveTest, RefusesEveryTruncatedArchive) {
  const std::string bytes = test::zip_file({{"a", "some content"}, {"b", "more"}});
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_FALSE(ZipArchive::open(folder_.write("a.zip", bytes.substr(0, n)))) << n;
}

TEST_F(ZipArchiveTest, RefusesWrongSizesAndDamage) {
  EXPECT_THAT(error_of_unpacking(with_size_byte(24, 1)),  // the lowest byte
              HasSubstr("unpacks to more than its stated size"));
  EXPECT_THAT(error_of_unpacking(with_size_byte(27, 0x70)),  // 1.75 GiB
              HasSubstr("far more than its own size"));
  std::string damaged = test::zip_file({{"a", "some content", false}});
  damaged[damaged.find("content")] ^= 1;
  EXPECT_NE(error_of_unpacking(damaged), "no error");
}

}  // namespace
}  // namespace fiducap
