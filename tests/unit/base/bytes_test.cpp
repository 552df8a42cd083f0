#include "base/bytes.hpp"

#include <gtest/gtest.h>

#include "support/hex.hpp"

namespace fiducap {
namespace {

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

TEST(ByteReader, SaysWhatWasWantedAndWhatWasLeft) {
  const auto bytes = from_hex("01 02 03");
  BigEndianReader in(bytes);
  in.u8();
  EXPECT_EQ(in.u32(), 0u);
  const auto result = in.check("cookie");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().text(), "cookie: needs 4 bytes at offset 1, only 2 left");
}

}  // namespace
}  // namespace fiducap
