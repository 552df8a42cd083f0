#include "capture/ros_image.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "support/results.hpp"

namespace fiducap::ros {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;

CameraModel camera(int width, int height) {
  return {width, height, 100, 100, width / 2.0, height / 2.0};
}

class RosImageTest : public testing::Test {
 protected:
  Expected<void> convert(std::string_view encoding, std::uint32_t step,
                         const std::vector<std::uint8_t>& data, bool big = false) {
    return conversion_.convert(
        {static_cast<std::uint32_t>(model_.width), static_cast<std::uint32_t>(model_.height),
         encoding, big, step, data},
        model_, gray_);
  }
  GrayConversion conversion_{16};
  CameraModel model_ = camera(2, 2);
  GrayImage gray_;
};

TEST_F(RosImageTest, ReadsTheBrightnessOfEachEncoding) {
  const std::vector<std::uint8_t> first_is_255{255, 0, 0, 255, 0, 0, 255, 0, 0, 255, 0, 0};
  const struct {
    const char* encoding;
    std::uint32_t step;
    std::vector<std::uint8_t> data, grays;
    bool big{false};
  } kCases[] = {{"mono8", 3, {1, 2, 99, 3, 4}, {1, 2, 3, 4}},  // padding, but not of the last row
                {"mono16", 5, {1, 10, 2, 20, 0, 3, 30, 4, 40}, {10, 20, 30, 40}},
                {"mono16", 4, {1, 10, 2, 20, 3, 30, 4, 40}, {1, 2, 3, 4}, true},
                {"rgb8", 6, first_is_255, {76, 76, 76, 76}},  // 0.299 × 255
                {"bgr8", 6, first_is_255, {29, 29, 29, 29}},  // 0.114 × 255
                {"yuv422", 4, {128, 50, 128, 60, 128, 70, 128, 80}, {50, 60, 70, 80}},
                {"yuv422_yuy2", 4, {50, 128, 60, 128, 70, 128, 80, 128}, {50, 60, 70, 80}}};
  for (const auto& [encoding, step, data, grays, big] : kCases) {
    ASSERT_TRUE(convert(encoding, step, data, big)) << encoding;
    EXPECT_EQ(gray_.pixels, grays) << encoding;
  }
}

TEST_F(RosImageTest, TakesTheBitsThatSixteenBitImagesUse) {
  conversion_ = GrayConversion();
  ASSERT_TRUE(convert("mono16", 4, {0xff, 0x03, 0x00, 0x02, 0x00, 0x01, 0x04, 0x00}));  // 10 bits
  EXPECT_THAT(gray_.pixels, ElementsAre(255, 128, 64, 1));
  ASSERT_TRUE(convert("16UC1", 4, {0x00, 0x08, 0x00, 0x02, 0x00, 0x01, 0x10, 0x00}));  // 12 bits
  EXPECT_THAT(gray_.pixels, ElementsAre(128, 32, 16, 1));
  ASSERT_TRUE(convert("mono16", 4, {0xff, 0x03, 0x00, 0x02, 0x00, 0x01, 0x04, 0x00}));
  EXPECT_THAT(gray_.pixels, ElementsAre(63, 32, 16, 0)) << "as bright as before";
}

TEST_F(RosImageTest, ReadsSixteenBitColoursAndTheFirstPlaneOfOthers) {
  std::vector<std::uint8_t> red;
  for (int i = 0; i < 4; ++i) red.insert(red.end(), {0xff, 0xff, 0, 0, 0, 0});
  ASSERT_TRUE(convert("rgb16", 12, red));
  EXPECT_THAT(gray_.pixels, testing::Each(76));
  for (const char* encoding : {"nv12", "nv21", "nv24"}) {
    ASSERT_TRUE(convert(encoding, 2, {1, 2, 3, 4, 128, 128}));
    EXPECT_THAT(gray_.pixels, ElementsAre(1, 2, 3, 4)) << encoding;
  }
  model_ = camera(8, 8);
  std::vector<std::uint8_t> bayer(128, 0);
  for (std::size_t y = 0; y < 8; y += 2)
    for (std::size_t x = 0; x < 8; x += 2) bayer[16 * y + 2 * x + 1] = 255;
  ASSERT_TRUE(convert("bayer_rggb16", 16, bayer));
  EXPECT_NEAR(gray_.pixels[8 * 4 + 4], 76, 1);
}

TEST_F(RosImageTest, ReadsBayerPatternsByTheirFirstColour) {
  // Only the red pixels shine: the image is as bright as red is for every pattern.
  model_ = camera(8, 8);
  const struct {
    const char* encoding;
    std::size_t x, y;
  } kRedAt[] = {
      {"bayer_rggb8", 0, 0}, {"bayer_bggr8", 1, 1}, {"bayer_gbrg8", 0, 1}, {"bayer_grbg8", 1, 0}};
  for (const auto& [encoding, first_x, first_y] : kRedAt) {
    std::vector<std::uint8_t> data(64, 0);
    for (std::size_t y = first_y; y < 8; y += 2)
      for (std::size_t x = first_x; x < 8; x += 2) data[8 * y + x] = 255;
    ASSERT_TRUE(convert(encoding, 8, data));
    EXPECT_NEAR(gray_.pixels[8 * 4 + 4], 76, 1) << encoding;
  }
}

TEST_F(RosImageTest, RefusesSizesThatTheDataDoNotHave) {
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  EXPECT_FALSE(convert("mono8", 2, {1, 2, 3}));
  EXPECT_FALSE(convert("mono8", 1, {1, 2, 3, 4, 5, 6}));
  EXPECT_FALSE(convert("mono8", 0, {1, 2, 3, 4}));
  EXPECT_FALSE(convert("mono8", kMost, {1, 2, 3, 4}));
  EXPECT_FALSE(convert("bgra8", 8, std::vector<std::uint8_t>(15)));
  EXPECT_FALSE(convert("32FC1", 8, std::vector<std::uint8_t>(16)));
  const RawImage huge{kMost, kMost, "mono8", false, 4, {}};
  EXPECT_THAT(error_of(conversion_.convert(huge, model_, gray_)),
              testing::HasSubstr("4294967295 x 4294967295, the calibration is for 2 x 2"));
}

class RosLens : public testing::Test {
 protected:
  RosLens() {
    info_.width = 640;
    info_.height = 480;
    info_.distortion_model = "plumb_bob";
    info_.K = {458, 0, 320, 0, 457, 240, 0, 0, 1};
    use_coefficients(5);
  }
  void use_coefficients(std::size_t count) {
    info_.coefficients = std::span(coefficients_).first(count);
  }
  double coefficients_[8]{-0.28, 0.07, 1e-4, 2e-4, 0.01, 1, 1, 1};
  CameraInfo info_{};
};

TEST_F(RosLens, ReadsPlumbBobAndEquidistantLenses) {
  const CameraModel lens = value_of(camera_model(info_));
  EXPECT_EQ(lens.distortion, Distortion::kRadialTangential);
  EXPECT_THAT(lens.coefficients, ElementsAre(-0.28, 0.07, 1e-4, 2e-4, 0.01, 0, 0, 0));
  EXPECT_EQ(lens.fv, 457);
  EXPECT_EQ(lens.cu, 320);
  info_.distortion_model = "equidistant";
  for (const std::size_t count : {4u, 0u}) {
    use_coefficients(count);
    EXPECT_EQ(value_of(camera_model(info_)).distortion, Distortion::kEquidistant) << count;
  }
}

TEST_F(RosLens, ReadsRationalLensesByAnyRadialName) {
  use_coefficients(8);
  for (const char* name : {"rational_polynomial", "plumb_bob", ""}) {
    info_.distortion_model = name;
    const CameraModel lens = value_of(camera_model(info_));
    EXPECT_EQ(lens.distortion, Distortion::kRational) << name;
    EXPECT_THAT(lens.coefficients, ElementsAreArray(coefficients_)) << name;
  }
}

TEST_F(RosLens, ReadsPaddedZerosAndUnnamedLenses) {
  // The T265's driver pads four numbers to five; Azure Kinect's and OAK's drivers pad to 12 or 14.
  const std::vector<double> fisheye{-0.009, 0.047, -0.045, 0.008, 0};
  info_.distortion_model = "equidistant";
  info_.coefficients = fisheye;
  EXPECT_EQ(value_of(camera_model(info_)).distortion, Distortion::kEquidistant);
  std::vector<double> padded(coefficients_, coefficients_ + 8);
  padded.resize(14);
  info_.distortion_model = "rational_polynomial";
  info_.coefficients = padded;
  EXPECT_EQ(value_of(camera_model(info_)).distortion, Distortion::kRational);
  padded[9] = 0.01;  // thin prism
  EXPECT_THAT(error_of(camera_model(info_)), testing::HasSubstr("thin prism"));
  const std::vector<double> zeros(8);
  info_.coefficients = zeros;
  for (const char* name : {"", "plumb_bob", "rational_polynomial", "unknown"}) {
    info_.distortion_model = name;
    EXPECT_THAT(value_of(camera_model(info_)).coefficients, testing::Each(0)) << name;
  }
  info_.distortion_model = "";
  use_coefficients(5);
  EXPECT_EQ(value_of(camera_model(info_)).distortion, Distortion::kRadialTangential);
  use_coefficients(4);
  EXPECT_FALSE(camera_model(info_)) << "a lens or a fisheye";
}

TEST_F(RosLens, ReadsTheLensOfRectifiedImagesFromP) {
  EXPECT_FALSE(camera_model(info_, true)) << "K and D are of the original images";
  info_.P = {400, 0, 310, 0, 0, 401, 235, 0, 0, 0, 1, 0};
  const CameraModel lens = value_of(camera_model(info_, true));
  EXPECT_EQ(lens.distortion, Distortion::kNone);
  EXPECT_THAT((std::array{lens.fu, lens.fv, lens.cu, lens.cv}), ElementsAre(400, 401, 310, 235));
  info_.P = {};
  use_coefficients(0);
  EXPECT_TRUE(camera_model(info_, true)) << "a camera without distortion needs no P";
}

TEST_F(RosLens, RefusesUnsupportedLensesAndSizes) {
  info_.distortion_model = "ds";
  EXPECT_THAT(error_of(camera_model(info_)), testing::HasSubstr("pinhole-equi"));
  info_.distortion_model = "equidistant";
  EXPECT_FALSE(camera_model(info_)) << "the fifth number is not zero";
  use_coefficients(0);
  info_.width = 0;
  EXPECT_FALSE(camera_model(info_));
  info_.width = 0xffffffff;
  EXPECT_FALSE(camera_model(info_));
  info_.width = 640;
  info_.binning_x = 2;
  EXPECT_FALSE(camera_model(info_));
  info_.binning_x = 0;
  info_.K[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(camera_model(info_));
}

TEST(RosLensTopic, IsBesideTheTopicOfTheImages) {
  EXPECT_EQ(camera_info_topic("/cam0/image_raw"), "/cam0/camera_info");
  EXPECT_EQ(camera_info_topic("/cam0/image_raw/compressed"), "/cam0/camera_info");
  EXPECT_EQ(camera_info_topic("/image"), "/camera_info");
  EXPECT_TRUE(is_compressed("/cam0/image_raw/compressed"));
  EXPECT_FALSE(is_compressed("/cam0/compressed_image"));
  EXPECT_TRUE(is_rectified("/cam0/image_rect"));
  EXPECT_TRUE(is_rectified("/infra1/image_rect_raw/compressed"));
  EXPECT_FALSE(is_rectified("/rectified/image_raw"));
}

}  // namespace
}  // namespace fiducap::ros
