#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "capture/gray_image.hpp"
#include "support/hex.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

std::vector<std::uint8_t> encoded(const std::string& ending, int width, int height,
                                  bool progressive = false) {
  std::vector<std::uint8_t> bytes;
  const cv::Mat image(height, width, CV_8UC3, cv::Scalar(10, 200, 30));
  cv::imencode(
      ending, image, bytes,
      progressive ? std::vector<int>{cv::IMWRITE_JPEG_PROGRESSIVE, 1} : std::vector<int>{});
  return bytes;
}

TEST(EncodedSize, IsThatOfWhatOpenCvWrote) {
  for (const PixelSize size : {PixelSize{752, 480}, PixelSize{1, 1}, PixelSize{65, 1023}}) {
    for (const auto& bytes :
         {encoded(".png", size.width, size.height), encoded(".jpg", size.width, size.height),
          encoded(".jpg", size.width, size.height, true)}) {
      EXPECT_EQ(encoded_size(std::as_bytes(std::span(bytes))), size);
    }
  }
}

TEST(EncodedSize, EveryTruncationOfTheHeaderIsAnError) {
  for (const char* ending : {".png", ".jpg"}) {
    const auto bytes = encoded(ending, 33, 44);
    std::size_t first_good = 0;
    while (first_good < bytes.size() &&
           !encoded_size(std::as_bytes(std::span(bytes).first(first_good))))
      ++first_good;
    EXPECT_GT(first_good, 16u);
    EXPECT_LT(first_good, bytes.size());
    for (std::size_t size = first_good; size < bytes.size(); ++size) {
      EXPECT_TRUE(encoded_size(std::as_bytes(std::span(bytes).first(size))));
    }
  }
}

TEST(EncodedSize, TellsPicturesFromOtherThings) {
  for (const char* other :
       {"", "ff", "ffd8", "ffd8ffd9", "ffd8ffda0008", "47494638396101000100", "89504e470d0a1a0a",
        "89504e470d0a1a0a0000000d49444154ffffffffffffffff", "ffd8ffe00001", "ffd8ffffffffff"}) {
    EXPECT_FALSE(encoded_size(from_hex(other))) << other;
  }
}

/// Gray grows to the right.
GrayImage ramp(int width, int height) {
  GrayImage image;
  image.resize(width, height);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      image.pixels[static_cast<std::size_t>(v * width + u)] =
          static_cast<std::uint8_t>(255 * u / (width - 1));
  return image;
}

class JpegImageTest : public testing::Test {
 protected:
  const GrayImage& scaled(const GrayImage& image, int width) {
    scale_down(image, width, out_, sums_);
    return out_;
  }
  GrayImage out_;
  std::vector<float> sums_;
};

TEST_F(JpegImageTest, ANarrowerImageShowsTheSame) {
  const GrayImage& small = scaled(ramp(752, 480), 320);
  EXPECT_EQ(small.width, 320);
  EXPECT_EQ(small.height, 204);
  for (int u = 0; u < 320; ++u)
    EXPECT_NEAR(small.pixels[static_cast<std::size_t>(100 * 320 + u)], 255 * (u + 0.5) / 320, 2.0);
}

TEST_F(JpegImageTest, HalfTheSizeAveragesFourPixels) {
  GrayImage image;
  image.resize(4, 2);
  image.pixels = {0, 100, 10, 10, 50, 50, 30, 30};
  EXPECT_EQ(scaled(image, 2).pixels, (std::vector<std::uint8_t>{50, 20}));
}

TEST_F(JpegImageTest, AnImageThatIsNotWiderIsCopied) {
  const GrayImage image = ramp(100, 40);
  EXPECT_EQ(scaled(image, 640).pixels, image.pixels);
  EXPECT_EQ(scaled({}, 640).pixels.size(), 0u);
}

TEST_F(JpegImageTest, OddSizesStayWithinTheImage) {
  for (int width = 1; width < 60; ++width) {
    const GrayImage& small = scaled(ramp(61, 37), width);
    EXPECT_EQ(small.width, width);
    EXPECT_EQ(small.pixels.size(), static_cast<std::size_t>(width * small.height));
  }
}

TEST_F(JpegImageTest, EncodesWhatAnybodyCanRead) {
  const GrayImage image = ramp(320, 200);
  std::vector<std::uint8_t> bytes{1, 2, 3};
  encode_jpeg(image, bytes);
  const cv::Mat read = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(read.cols, 320);
  ASSERT_EQ(read.rows, 200);
  constexpr double kCompression_gray = 6;  // of quality 80
  for (int u = 0; u < 320; u += 7)
    EXPECT_NEAR(read.at<std::uint8_t>(100, u),
                image.pixels[static_cast<std::size_t>(100 * 320 + u)], kCompression_gray);
  encode_jpeg({}, bytes);
  EXPECT_TRUE(bytes.empty());
}

using testing::HasSubstr;

class GrayFileTest : public testing::Test {
 protected:
  /// A PNG of a few bytes that says of itself to be larger.
  std::string boasting(int width, int height) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(7)), bytes);
    constexpr std::size_t kWidthAt = 16;  // signature, length and name of the first chunk
    for (std::size_t i = 0; i < 4; ++i) {
      bytes[kWidthAt + i] = static_cast<std::uint8_t>(width >> (24 - 8 * i));
      bytes[kWidthAt + 4 + i] = static_cast<std::uint8_t>(height >> (24 - 8 * i));
    }
    return folder_.write("image.png", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }

  TemporaryFolder folder_;
  std::vector<std::uint8_t> scratch_;
  GrayImage image_;
};

TEST_F(GrayFileTest, IsReadInItsOwnSizeOrInTheOneWanted) {
  const std::string file = boasting(8, 6);
  ASSERT_TRUE(read_gray_file_of_any_size(file, scratch_, image_));
  EXPECT_EQ(image_.width, 8);
  EXPECT_EQ(image_.height, 6);
  EXPECT_EQ(image_.pixels[47], 7);
  image_.resize(8, 6);
  EXPECT_TRUE(read_gray_file(file, scratch_, image_));
}

TEST_F(GrayFileTest, AFewBytesThatAskForGigabytesAreNotDecoded) {
  const std::string file = boasting(30'000, 30'000);
  EXPECT_THAT(read_gray_file_of_any_size(file, scratch_, image_).error().text(),
              HasSubstr("is 30000 x 30000: larger than any camera image"));
  image_.resize(8, 6);
  EXPECT_THAT(read_gray_file(file, scratch_, image_).error().text(),
              HasSubstr("is 30000 x 30000, the calibration is for 8 x 6"));
}

}  // namespace
}  // namespace fiducap
