#include "capture/v4l2/jpeg_gray.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

namespace fiducap::v4l2 {
namespace {

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
