#include "capture/encoded_size.hpp"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>

#include "support/hex.hpp"

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

}  // namespace
}  // namespace fiducap
