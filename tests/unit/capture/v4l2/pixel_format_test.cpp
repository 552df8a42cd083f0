#include <linux/videodev2.h>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "capture/v4l2/pixel_format.hpp"
#include "support/results.hpp"

namespace fiducap::v4l2 {
namespace {

using testing::HasSubstr;

// Four pixels of 0x1ab, 0x2cd, 0x3ef, 0x012 (ten bits): 0x6a, 0xb3, 0xfb, 0x04 without the lower
// two; bytes as in the kernel's description of each format.
TEST(PixelFormat, ReadsTheUpperEightBitsOfEachLayout) {
  const struct {
    const char* format;
    std::vector<int> bytes, grays;
  } kCases[] = {
      {"GREY", {1, 2, 255}, {1, 2, 255}},
      {"YUYV", {1, 90, 2, 91, 3, 90, 4, 91}, {1, 2, 3, 4}},
      {"UYVY", {90, 1, 91, 2, 90, 3, 91, 4}, {1, 2, 3, 4}},
      {"Y10", {0xab, 1, 0xcd, 2, 0xef, 3, 0x12, 0}, {0x6a, 0xb3, 0xfb, 0x04}},
      {"Y10", {0xff, 0xff}, {255}},  // more bits than ten do not wrap
      {"Y12", {0xab, 0x06, 0xff, 0x0f}, {0x6a, 0xff}},
      {"Y16", {0x99, 0x6a}, {0x6a}},
      {"Y16_BE", {0x6a, 0x99}, {0x6a}},
      {"Y10P", {0x6a, 0xb3, 0xfb, 0x04, 0xb7}, {0x6a, 0xb3, 0xfb, 0x04}},
      {"Y12P", {0x6a, 0xb3, 0x55, 0xfb, 0x04, 0x55}, {0x6a, 0xb3, 0xfb, 0x04}},
      // 0110101011 1011001101 1111101111 0000010010
      {"Y10BPACK", {0x6a, 0xec, 0xdf, 0xbc, 0x12}, {0x6a, 0xb3, 0xfb, 0x04}},
  };
  for (const auto& [format, bytes, grays] : kCases) {
    std::vector<std::byte> raw;
    for (const int byte : bytes) raw.push_back(static_cast<std::byte>(byte));
    GrayImage image;
    image.resize(static_cast<int>(grays.size()), 1);
    EXPECT_TRUE(read_gray(*pixel_format(std::string_view(format)), raw, 0, image)) << format;
    EXPECT_THAT(image.pixels, testing::ElementsAreArray(grays)) << format;
  }
}

TEST(PixelFormat, ReadsNothingBeyondTheRowAtAnyWidth) {
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

TEST(PixelFormat, SkipsThePaddingOfRows) {
  std::vector<std::byte> bytes(2 * 8 - 4, std::byte{9});  // none behind the last row
  bytes[0] = std::byte{1};
  bytes[8] = std::byte{2};
  GrayImage image;
  image.resize(4, 2);
  ASSERT_TRUE(read_gray(*pixel_format(V4L2_PIX_FMT_GREY), bytes, 8, image));
  EXPECT_THAT(image.pixels, testing::ElementsAre(1, 9, 9, 9, 2, 9, 9, 9));
}

TEST(PixelFormat, IsFoundByCodeAndByName) {
  EXPECT_EQ(pixel_format(V4L2_PIX_FMT_MJPEG), pixel_format(std::string_view("MJPEG")));
  EXPECT_EQ(pixel_format(V4L2_PIX_FMT_SRGGB8), nullptr);
  EXPECT_EQ(code_text(V4L2_PIX_FMT_YUYV), "YUYV");
  EXPECT_EQ(code_text(0x01020304), "????");
}

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
  std::string error() { return error_of(reader_.read(std::as_bytes(std::span(jpeg_)), image_)); }

  std::vector<std::uint8_t> jpeg_;
  GrayImage image_;
  JpegGray reader_;
};

TEST_F(JpegGrayTest, ReadsSeveralImagesAndIgnoresBytesBehindThem) {
  const cv::Mat expected = cv::imdecode(jpeg_, cv::IMREAD_GRAYSCALE);
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(error(), "no error");
    for (std::size_t k = 0; k < image_.pixels.size(); ++k)
      ASSERT_NEAR(image_.pixels[k], expected.data[k], kTransforms);
    std::fill(image_.pixels.begin(), image_.pixels.end(), std::uint8_t{0});
  }
  jpeg_.resize(jpeg_.size() + 1000);  // buffers of USB cameras are filled up with zeros
  EXPECT_EQ(error(), "no error");
}

TEST_F(JpegGrayTest, RefusesEveryTruncatedImage) {
  const std::vector<std::uint8_t> whole = jpeg_;
  int accepted = 0;
  for (auto end = whole.begin(); end + 2 < whole.end(); ++end) {
    jpeg_.assign(whole.begin(), end);
    accepted += error() == "no error";
  }
  EXPECT_EQ(accepted, 0);
  jpeg_ = whole;
  EXPECT_EQ(error(), "no error") << "the next whole image is read";
}

TEST_F(JpegGrayTest, RefusesPartialImagesOtherSizesAndOtherData) {
  image_.resize(32, 48);
  EXPECT_THAT(error(), HasSubstr("64 x 48 instead of 32 x 48"));
  image_.resize(64, 48);
  std::fill(jpeg_.begin() + static_cast<std::ptrdiff_t>(jpeg_.size()) * 2 / 3, jpeg_.end(),
            std::uint8_t{0});
  EXPECT_THAT(error(), HasSubstr("damaged or ends too early"));
  jpeg_.assign(100, 0x55);
  EXPECT_NE(error(), "no error");
  jpeg_.clear();
  EXPECT_NE(error(), "no error");
}

}  // namespace
}  // namespace fiducap::v4l2
