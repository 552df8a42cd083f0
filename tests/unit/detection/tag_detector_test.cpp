#include "detection/tag_detector.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace fiducap {
namespace {

CameraFrame gray_frame(int width, int height, std::uint8_t value) {
  auto image = std::make_shared<GrayImage>();
  image->resize(width, height);
  std::fill(image->pixels.begin(), image->pixels.end(), value);
  return {2, instant_from_ns(7), image};
}

TEST(TagDetector, AnImageWithoutTagsIsANormalAnswer) {
  TagDetector detector({}, {});
  const CornerFrame out = detector.detect(gray_frame(320, 240, 128));
  EXPECT_TRUE(out.tags.empty());
  EXPECT_EQ(out.camera, 2);
  EXPECT_EQ(out.exposed_at, instant_from_ns(7));
}

TEST(TagDetector, AFrameWithoutImageGivesNothing) {
  TagDetector detector({}, {});
  EXPECT_TRUE(detector.detect({}).tags.empty());
}

TEST(DetectorConfig, NamesEveryBrokenRule) {
  TagSetConfig tags;
  tags.family = "tag99";
  tags.size_m = -1;
  tags.sizes_m[4] = 0;
  EXPECT_EQ(tags.check().size(), 3u);
  DetectorConfig detector;
  detector.decimate = 0.5;
  ASSERT_EQ(detector.check().size(), 1u);
  EXPECT_EQ(detector.check()[0].text(), "detector.decimate = 0.5: must be in [1, 8]");
}

}  // namespace
}  // namespace fiducap
