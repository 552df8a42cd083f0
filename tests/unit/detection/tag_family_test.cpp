#include "detection/tag_family.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "detection/tag_detector.hpp"

namespace fiducap {
namespace {

constexpr int kModule_px = 12;
constexpr int kRing = 2;  // white modules around what is printed

GrayImage picture_of(const TagFamily& family, int id) {
  const std::vector<std::uint8_t> modules = family.modules(id);
  const int side = family.width() + 2 * kRing;
  GrayImage image{side * kModule_px, side * kModule_px, {}};
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const int row = y / kModule_px - kRing;
      const int column = x / kModule_px - kRing;
      const bool inside =
          row >= 0 && column >= 0 && row < family.width() && column < family.width();
      image.pixels.push_back(
          inside ? modules[static_cast<std::size_t>(row * family.width() + column)] : 255);
    }
  }
  return image;
}

TEST(TagFamily, EveryFamilyThatIsDrawnIsRead) {
  std::istringstream names(tag_family_names());
  int families = 0;
  for (std::string name; std::getline(names >> std::ws, name, ',');) {
    const auto family = TagFamily::named(name);
    ASSERT_TRUE(family) << name;
    ++families;
    TagDetector detector({.family = name}, {});
    const int id = family->ids() / 2;
    const auto image = std::make_shared<GrayImage>(picture_of(*family, id));
    const CornerFrame found = detector.detect(CameraFrame{0, Instant{}, image});
    ASSERT_EQ(found.tags.size(), 1u) << name;
    EXPECT_EQ(found.tags[0].tag_id, id) << name;
    const double edge_px = (found.tags[0].corners_px[1] - found.tags[0].corners_px[0]).norm();
    EXPECT_NEAR(edge_px, family->edge_width() * kModule_px, 1) << name;
  }
  EXPECT_GE(families, 7);
}

TEST(TagFamily, AnUnknownOneIsRefusedNamingTheKnown) {
  const auto family = TagFamily::named("tag99");
  ASSERT_FALSE(family);
  EXPECT_NE(family.error().what.find("tag36h11, tag36h10"), std::string::npos);
  EXPECT_FALSE(is_tag_family("tag99"));
  EXPECT_TRUE(is_tag_family("tag36h11"));
}

}  // namespace
}  // namespace fiducap
