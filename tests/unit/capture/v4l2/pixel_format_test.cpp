#include <numeric>

#include <linux/videodev2.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "capture/v4l2/pixel_format.hpp"

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

using testing::HasSubstr;

// libjpeg's integer transform against OpenCV's choice of it.
constexpr int kTransforms = 4;

class JpegGrayTest : public testing::Test {
 protected:
  JpegGrayTest() {
    cv::Mat picture(48, 64, CV_8UC3);
    for (int v = 0; v < 48; ++v)
      for (int u = 0; u < 64; ++u)
        picture.at<cv::Vec3b>(v, u) = cv::Vec3b::all(static_cast<std::uint8_t>(40 + 2 * u + v));
    cv::imencode(".jpg", picture, jpeg_);
    image_.resize(64, 48);
  }
  std::string error() {
    const auto read = reader_.read(std::as_bytes(std::span(jpeg_)), image_);
    return read ? "none" : read.error().text();
  }

  std::vector<std::uint8_t> jpeg_;
  GrayImage image_;
  JpegGray reader_;
};

TEST_F(JpegGrayTest, GrayIsReadAgainAndAgain) {
  const cv::Mat expected = cv::imdecode(jpeg_, cv::IMREAD_GRAYSCALE);
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(error(), "none");
    for (std::size_t k = 0; k < image_.pixels.size(); ++k)
      ASSERT_NEAR(image_.pixels[k], expected.data[k], kTransforms);
    std::fill(image_.pixels.begin(), image_.pixels.end(), std::uint8_t{0});
  }
}

TEST_F(JpegGrayTest, BytesBehindTheEndDoNotMatter) {
  jpeg_.resize(jpeg_.size() + 1000);  // buffers of USB cameras are filled up with zeros
  EXPECT_EQ(error(), "none");
}

TEST_F(JpegGrayTest, EveryImageThatEndsTooEarlyIsNoticed) {
  const std::vector<std::uint8_t> whole = jpeg_;
  int read_though_cut = 0;
  for (std::size_t size = 0; size + 2 < whole.size(); ++size) {
    jpeg_.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    read_though_cut += error() == "none";
  }
  EXPECT_EQ(read_though_cut, 0);
  jpeg_ = whole;
  EXPECT_EQ(error(), "none") << "the next whole image is read";
}

TEST_F(JpegGrayTest, HalfAnImageFilledUpWithZerosIsNoticed) {
  std::fill(jpeg_.begin() + static_cast<std::ptrdiff_t>(jpeg_.size()) * 2 / 3, jpeg_.end(),
            std::uint8_t{0});
  EXPECT_THAT(error(), HasSubstr("damaged or ends too early"));
}

TEST_F(JpegGrayTest, AnotherSizeIsRefusedBeforeItIsDecoded) {
  image_.resize(32, 48);
  EXPECT_THAT(error(), HasSubstr("64 x 48 instead of 32 x 48"));
}

TEST_F(JpegGrayTest, WhatIsNoJpegIsRefused) {
  jpeg_.assign(100, 0x55);
  EXPECT_NE(error(), "none");
  jpeg_.clear();
  EXPECT_NE(error(), "none");
}

}  // namespace
}  // namespace fiducap::v4l2
