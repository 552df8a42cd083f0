#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "capture/gray_image.hpp"
#include "support/hex.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

std::vector<std::uint8_t> encoded(const std::string& ending, PixelSize size,
                                  const std::vector<int>& options = {}) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(ending, cv::Mat(size.height, size.width, CV_8UC3, cv::Scalar(10, 200, 30)), bytes,
               options);
  return bytes;
}

Expected<PixelSize> size_in(std::span<const std::uint8_t> bytes) {
  return encoded_size(std::as_bytes(bytes));
}

TEST(EncodedSize, IsReadFromImagesOfOpenCv) {
  for (const PixelSize size : {PixelSize{752, 480}, PixelSize{1, 1}, PixelSize{65, 1023}}) {
    EXPECT_EQ(size_in(encoded(".png", size)), size);
    EXPECT_EQ(size_in(encoded(".jpg", size)), size);
    EXPECT_EQ(size_in(encoded(".jpg", size, {cv::IMWRITE_JPEG_PROGRESSIVE, 1})), size);
    for (const char* ending : {".bmp", ".ppm", ".tiff"})
      EXPECT_EQ(size_in(encoded(ending, size)), size) << ending;
  }
}

TEST(EncodedSize, RefusesEveryTruncationOfTheHeader) {
  for (const char* ending : {".png", ".jpg"}) {
    const auto bytes = encoded(ending, {33, 44});
    std::size_t size = 0;
    while (size < bytes.size() && !size_in(std::span(bytes).first(size))) ++size;
    EXPECT_GT(size, 16u);
    EXPECT_LT(size, bytes.size());
    for (; size < bytes.size(); ++size) EXPECT_TRUE(size_in(std::span(bytes).first(size)));
  }
}

// Each scan of a progressive JPEG costs as much as all pixels, and a few bytes.
TEST(EncodedSize, RefusesAJpegOfThousandsOfScans) {
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", cv::Mat(48, 64, CV_8UC1, cv::Scalar(9)), jpeg);
  EXPECT_TRUE(encoded_size(std::as_bytes(std::span(jpeg))));
  for (int i = 0; i < 1000; ++i) jpeg.insert(jpeg.end(), {0xff, 0xda});
  EXPECT_THAT(error_of(encoded_size(std::as_bytes(std::span(jpeg)))), HasSubstr("100 scans"));
}

TEST(EncodedSize, IsReadFromTheirVariants) {
  const auto of = [](std::string_view text) {
    return encoded_size(std::as_bytes(std::span(text)));
  };
  EXPECT_EQ(of("P5 # 9\n# 8 7\n 33\t44\n255\n"), (PixelSize{33, 44}));
  EXPECT_EQ(encoded_size(from_hex("424d"
                                  "000000000000000000000000"
                                  "28000000"
                                  "21000000"
                                  "d4ffffff")),
            (PixelSize{33, 44}));
  EXPECT_EQ(encoded_size(from_hex("424d"
                                  "000000000000000000000000"
                                  "0c000000"
                                  "2100"
                                  "2c00")),
            (PixelSize{33, 44}));
  EXPECT_EQ(encoded_size(from_hex("4d4d002a"
                                  "00000008"
                                  "0002"
                                  "0100"
                                  "0003"
                                  "00000001"
                                  "00210000"
                                  "0101"
                                  "0004"
                                  "00000001"
                                  "0000002c")),
            (PixelSize{33, 44}));
}

// OpenCV would decode them; nothing bounds what they claim.
TEST(EncodedSize, RefusesOtherFormatsByName) {
  for (const char* ending : {".jp2", ".webp", ".hdr", ".exr"}) {
    std::vector<std::uint8_t> bytes;
    try {
      bytes = encoded(ending, {33, 44});
    } catch (const cv::Exception&) {
      continue;  // not in every build of OpenCV
    }
    EXPECT_THAT(error_of(size_in(bytes)), HasSubstr("convert it")) << ending;
  }
}

TEST(EncodedSize, RefusesOtherFiles) {
  for (const char* other :
       {"", "ff", "ffd8", "ffd8ffd9", "ffd8ffda0008", "47494638396101000100", "89504e470d0a1a0a",
        "89504e470d0a1a0a0000000d49444154ffffffffffffffff", "ffd8ffe00001", "ffd8ffffffffff",
        "762f3101", "424d", "5035", "5035203333203434", "503520332061", "49492a00",
        "49492a00ffffffff", "49492a000800000001000001030001000000",
        "4d4d002a000000080001010000030000000100210000"}) {
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

TEST_F(JpegImageTest, ScalesAnImageDown) {
  const GrayImage& small = scaled(ramp(752, 480), 320);
  EXPECT_EQ(small.width, 320);
  EXPECT_EQ(small.height, 204);
  for (int u = 0; u < 320; ++u)
    EXPECT_NEAR(small.pixels[static_cast<std::size_t>(100 * 320 + u)], 255 * (u + 0.5) / 320, 2.0);
  GrayImage image;
  image.resize(4, 2);
  image.pixels = {0, 100, 10, 10, 50, 50, 30, 30};
  EXPECT_THAT(scaled(image, 2).pixels, testing::ElementsAre(50, 20)) << "means of four pixels";
}

TEST_F(JpegImageTest, CopiesAnImageThatIsNotWider) {
  const GrayImage image = ramp(100, 40);
  EXPECT_EQ(scaled(image, 640).pixels, image.pixels);
  EXPECT_EQ(scaled({}, 640).pixels.size(), 0u);
}

TEST_F(JpegImageTest, KeepsOddSizesWithinTheImage) {
  for (int width = 1; width < 60; ++width) {
    const GrayImage& small = scaled(ramp(61, 37), width);
    EXPECT_EQ(small.width, width);
    EXPECT_EQ(small.pixels.size(), static_cast<std::size_t>(width * small.height));
  }
}

TEST_F(JpegImageTest, EncodesJpegThatOpenCvReads) {
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

class GrayFileTest : public testing::Test {
 protected:
  /// A PNG of a few bytes with this size in its header.
  std::string png_claiming(int width, int height) {
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
  GrayDecoder decoder_;
  GrayImage image_;
};

TEST_F(GrayFileTest, DecodesNoSmallFileThatClaimsGigabytes) {
  const std::string file = png_claiming(30'000, 30'000);
  EXPECT_THAT(error_of(decoder_.read_file(file, {}, image_)),
              HasSubstr("is 30000 x 30000: larger than any camera image"));
  EXPECT_THAT(error_of(decoder_.read_file(file, PixelSize{8, 6}, image_)),
              HasSubstr("is 30000 x 30000, the calibration is for 8 x 6"));
}

TEST_F(GrayFileTest, DecodesImagesOfTheCalibratedSize) {
  for (const char* ending : {".png", ".jpg"}) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(ending, cv::Mat(48, 64, CV_8UC1, cv::Scalar(77)), bytes);
    ASSERT_TRUE(decoder_.decode(bytes, PixelSize{64, 48}, image_));
    EXPECT_THAT(image_.pixels, testing::Each(testing::AllOf(testing::Ge(76), testing::Le(78))));
    EXPECT_FALSE(decoder_.decode(bytes, PixelSize{48, 64}, image_));
    if (ending == std::string_view(".png")) {
      auto huge = bytes;
      huge[16] = huge[20] = 0x7f;  // width and height
      EXPECT_FALSE(decoder_.decode(huge, PixelSize{64, 48}, image_));
    }
    bytes.resize(40);
    EXPECT_FALSE(decoder_.decode(bytes, PixelSize{64, 48}, image_));
  }
}

TEST_F(GrayFileTest, TakesTheHighestBitsThatAreUsed) {
  const auto png = [](int value) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".png", cv::Mat(4, 4, CV_16UC1, cv::Scalar(value)), bytes);
    return bytes;
  };
  const struct {
    int value, bits, gray;
  } kCases[] = {{200, 8, 200}, {800, 10, 200}, {400, 10, 100}, {12800, 14, 200}, {51200, 16, 200}};
  for (const auto& [value, bits, gray] : kCases) {
    ASSERT_TRUE(decoder_.decode(png(value), {}, image_));
    EXPECT_EQ(decoder_.used_bits(), bits);
    EXPECT_THAT(image_.pixels, testing::Each(gray)) << value;
  }
  EXPECT_TRUE(decoder_.saw_16_bits());
  // A counter in the first pixel.
  cv::Mat counted(40, 40, CV_16UC1, cv::Scalar(800));
  counted.at<std::uint16_t>(0, 0) = 65535;
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", counted, bytes);
  GrayDecoder other;
  ASSERT_TRUE(other.decode(bytes, {}, image_));
  EXPECT_EQ(other.used_bits(), 10);
  EXPECT_EQ(image_.pixels.front(), 255);
  EXPECT_EQ(image_.pixels.back(), 200);
}

}  // namespace
}  // namespace fiducap
