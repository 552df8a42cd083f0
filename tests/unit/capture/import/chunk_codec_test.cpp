#include "capture/import/message_log.hpp"

#include <gmock/gmock.h>
#include <lz4frame.h>
#include <zstd.h>

#include "base/bytes.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

std::string zstd(const std::string& text) {
  std::string out(ZSTD_compressBound(text.size()), '\0');
  out.resize(ZSTD_compress(out.data(), out.size(), text.data(), text.size(), 1));
  return out;
}

std::string lz4(const std::string& text) {
  std::string out(LZ4F_compressFrameBound(text.size(), nullptr), '\0');
  out.resize(LZ4F_compressFrame(out.data(), out.size(), text.data(), text.size(), nullptr));
  return out;
}

std::string long_text() {
  std::string text;
  for (int i = 0; i < 100'000; ++i) text += "aaa";
  return text + "end";
}

class ChunkCodecTest : public testing::Test {
 protected:
  std::vector<std::byte> out_;
  const std::string text_ = long_text();
};

TEST_F(ChunkCodecTest, WhatWasPackedComesBack) {
  for (const auto& [name, packed] :
       {std::pair("zstd", zstd(text_)), std::pair("lz4", lz4(text_)), std::pair("none", text_)}) {
    ASSERT_TRUE(unpack_chunk(name, bytes_of(packed), text_.size(), out_)) << name;
    EXPECT_TRUE(std::ranges::equal(out_, bytes_of(text_))) << name;
  }
}

TEST_F(ChunkCodecTest, BytesBehindAFrameAreOfNoConcern) {
  EXPECT_TRUE(unpack_chunk("zstd", bytes_of(zstd(text_) + "padding"), text_.size(), out_));
}

TEST_F(ChunkCodecTest, AnotherSizeThanSaidIsAnError) {
  const auto less = unpack_chunk("zstd", bytes_of(zstd(text_)), text_.size() + 1, out_);
  ASSERT_FALSE(less);
  EXPECT_THAT(less.error().what, HasSubstr("unpacks to 300003 bytes, not to 300004"));
  EXPECT_FALSE(unpack_chunk("lz4", bytes_of(lz4(text_)), 100, out_));
  EXPECT_LE(out_.size(), 65536u) << "more than what was said is not unpacked";
}

TEST_F(ChunkCodecTest, WhatIsCutOrDamagedIsAnError) {
  for (const auto& [name, packed] :
       {std::pair("zstd", zstd(text_)), std::pair("lz4", lz4(text_))}) {
    const std::string cut = packed.substr(0, packed.size() - 5);
    EXPECT_FALSE(unpack_chunk(name, bytes_of(cut), text_.size(), out_)) << name;
    EXPECT_FALSE(unpack_chunk(name, bytes_of("no such thing"), text_.size(), out_)) << name;
  }
  EXPECT_FALSE(unpack_chunk("bz2", bytes_of("BZh9 and no more"), text_.size(), out_));
  EXPECT_FALSE(unpack_chunk("lzma", bytes_of("x"), 1, out_));
}

TEST_F(ChunkCodecTest, ASizeThatNoMessageHasIsRefusedBeforeAnythingIsDone) {
  EXPECT_FALSE(unpack_chunk("zstd", bytes_of(zstd(text_)), std::uint64_t{1} << 40, out_));
  EXPECT_TRUE(out_.empty());
}

}  // namespace
}  // namespace fiducap
