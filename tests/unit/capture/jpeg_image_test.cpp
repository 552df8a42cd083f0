#include "capture/jpeg_image.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

namespace fiducap {
namespace {

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

}  // namespace
}  // namespace fiducap
