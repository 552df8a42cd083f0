#include "capture/v4l2/pixel_format.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <linux/videodev2.h>

#include <numeric>

namespace fiducap::v4l2 {
namespace {

using testing::ElementsAre;

std::vector<std::uint8_t> gray_of(const char* name, std::initializer_list<int> bytes, int width) {
  std::vector<std::byte> raw;
  for (const int byte : bytes) raw.push_back(static_cast<std::byte>(byte));
  GrayImage image;
  image.resize(width, 1);
  EXPECT_TRUE(read_gray(*pixel_format(std::string_view(name)), raw, 0, image));
  return image.pixels;
}

// Four pixels of 0x1ab, 0x2cd, 0x3ef, 0x012 (ten bits): 0x6a, 0xb3, 0xfb, 0x04 without the lower
// two. The bytes are written down from the kernel's description of each format.
TEST(PixelFormat, GrayIsTheUpperEightBitsOfEachLayout) {
  EXPECT_THAT(gray_of("GREY", {1, 2, 255}, 3), ElementsAre(1, 2, 255));
  EXPECT_THAT(gray_of("YUYV", {1, 90, 2, 91, 3, 90, 4, 91}, 4), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(gray_of("UYVY", {90, 1, 91, 2, 90, 3, 91, 4}, 4), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(gray_of("Y10", {0xab, 0x01, 0xcd, 0x02, 0xef, 0x03, 0x12, 0x00}, 4),
              ElementsAre(0x6a, 0xb3, 0xfb, 0x04));
  EXPECT_THAT(gray_of("Y12", {0xab, 0x06, 0xff, 0x0f}, 2), ElementsAre(0x6a, 0xff));
  EXPECT_THAT(gray_of("Y16", {0x99, 0x6a}, 1), ElementsAre(0x6a));
  EXPECT_THAT(gray_of("Y16_BE", {0x6a, 0x99}, 1), ElementsAre(0x6a));
  EXPECT_THAT(gray_of("Y10P", {0x6a, 0xb3, 0xfb, 0x04, 0xb7}, 4),
              ElementsAre(0x6a, 0xb3, 0xfb, 0x04));
  EXPECT_THAT(gray_of("Y12P", {0x6a, 0xb3, 0x55, 0xfb, 0x04, 0x55}, 4),
              ElementsAre(0x6a, 0xb3, 0xfb, 0x04));
  // 0110101011 1011001101 1111101111 0000010010
  EXPECT_THAT(gray_of("Y10BPACK", {0x6a, 0xec, 0xdf, 0xbc, 0x12}, 4),
              ElementsAre(0x6a, 0xb3, 0xfb, 0x04));
}

TEST(PixelFormat, MoreBitsThanPromisedDoNotWrap) {
  EXPECT_THAT(gray_of("Y10", {0xff, 0xff}, 1), ElementsAre(255));
}

TEST(PixelFormat, WidthsThatAreNoMultipleOfAGroupReadNothingBeyondTheirRow) {
  for (const PixelFormat& format : pixel_formats()) {
    if (format.layout == Layout::kJpeg) continue;
    for (int width = 1; width <= 9; ++width) {
      const std::size_t row = row_bytes(format, width);
      const std::vector<std::byte> bytes(3 * row);  // exactly: the sanitizers look behind it
      GrayImage image;
      image.resize(width, 3);
      EXPECT_TRUE(read_gray(format, bytes, row, image)) << format.name << " " << width;
      EXPECT_FALSE(read_gray(format, std::span(bytes).first(3 * row - 1), row, image));
    }
  }
}

TEST(PixelFormat, PaddingBehindEachRowIsSkipped) {
  std::vector<std::byte> bytes(2 * 8 - 4, std::byte{9});  // none behind the last row
  bytes[0] = std::byte{1};
  bytes[8] = std::byte{2};
  GrayImage image;
  image.resize(4, 2);
  ASSERT_TRUE(read_gray(*pixel_format(V4L2_PIX_FMT_GREY), bytes, 8, image));
  EXPECT_THAT(image.pixels, ElementsAre(1, 9, 9, 9, 2, 9, 9, 9));
}

TEST(PixelFormat, IsFoundByCodeAndByName) {
  EXPECT_EQ(pixel_format(V4L2_PIX_FMT_MJPEG), pixel_format(std::string_view("MJPEG")));
  EXPECT_EQ(pixel_format(V4L2_PIX_FMT_SRGGB8), nullptr);
  EXPECT_EQ(code_text(V4L2_PIX_FMT_YUYV), "YUYV");
  EXPECT_EQ(code_text(0x01020304), "????");
}

}  // namespace
}  // namespace fiducap::v4l2
