#include "capture/recording/gray_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

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
              HasSubstr("is 30000 x 30000: no camera has so many pixels"));
  image_.resize(8, 6);
  EXPECT_THAT(read_gray_file(file, scratch_, image_).error().text(),
              HasSubstr("is 30000 x 30000, the calibration is for 8 x 6"));
}

}  // namespace
}  // namespace fiducap
