#include "base/bytes.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "base/whole_file.hpp"
#include "support/hex.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;

TEST(ByteWriter, WritesBothOrders) {
  std::vector<std::byte> big, little;
  BigEndianWriter(big).u16(0x0102).i32(-2).f64(1.0);
  LittleEndianWriter(little).u16(0x0102).i32(-2).f64(1.0);
  EXPECT_EQ(big, from_hex("0102 fffffffe 3ff0000000000000"));
  EXPECT_EQ(little, from_hex("0201 feffffff 000000000000f03f"));
}

TEST(ByteReader, ReadsWhatTheWriterWrote) {
  std::vector<std::byte> bytes;
  BigEndianWriter(bytes).u8(7).u64(0x1122334455667788).f32(-0.5f).i64(-9);
  BigEndianReader in(bytes);
  EXPECT_EQ(in.u8(), 7);
  EXPECT_EQ(in.u64(), 0x1122334455667788u);
  EXPECT_EQ(in.f32(), -0.5f);
  EXPECT_EQ(in.i64(), -9);
  EXPECT_EQ(in.left(), 0u);
  EXPECT_TRUE(in.check("x"));
}

TEST(ByteReader, ErrorHasTheOffsetAndTheBytesLeft) {
  const auto bytes = from_hex("01 02 03");
  BigEndianReader in(bytes);
  in.u8();
  EXPECT_EQ(in.u32(), 0u);
  EXPECT_EQ(error_of(in.check("cookie")), "cookie: needs 4 bytes at offset 1, only 2 left");
}

TEST(WholeFile, RoundTripCreatesFoldersAndLeavesNoParts) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a/b/text");
  value_of(write_whole_file(path, "one"));
  value_of(write_whole_file(path, "two\nlines"));
  EXPECT_EQ(value_of(read_whole_file(path)), "two\nlines");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.file("a/b")), fs::directory_iterator()), 1);
}

TEST(WholeFile, FollowsNoLinkAndFillsNoFileOfOthers) {
  const TemporaryFolder folder;
  const std::string path = folder.file("robot.token");
  const std::string precious = folder.write("precious", "precious");
  fs::create_symlink(precious, path + ".part" + std::to_string(::getpid()));
  value_of(write_whole_file(path, "secret", 0600));
  EXPECT_EQ(value_of(read_whole_file(precious)), "precious");
  EXPECT_FALSE(fs::is_symlink(path));
  EXPECT_EQ(fs::status(path).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST(WholeFile, ReportsFailures) {
  const TemporaryFolder folder;
  const std::string ten = folder.write("ten", "0123456789");
  EXPECT_EQ(write_whole_file(ten + "/below", "y").error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(read_whole_file(folder.file("none")).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(read_whole_file(ten, 9).error().code, ErrorCode::kUnsupported);
  EXPECT_TRUE(read_whole_file(ten, 10));
}

}  // namespace
}  // namespace fiducap
