#include "detection/tag_family.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "detection/tag_detector.hpp"
#include "printed_tag.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr int kSampled = 6;
/// Grays are rounded, which leaves three thousandths of a pixel.
constexpr double kCorner_px = 0.01;

/// Of all sizes: the first, the last and some between.
std::set<int> sampled_ids(const TagFamily& family) {
  std::set<int> ids;
  for (int k = 0; k < kSampled; ++k)
    ids.insert(static_cast<int>(std::int64_t{k} * (family.ids() - 1) / (kSampled - 1)));
  std::erase_if(ids, [&](int id) { return !family.has_pose(id); });
  return ids;
}

std::vector<TagSighting> read(TagDetector& detector, std::shared_ptr<const GrayImage> image) {
  return detector.detect(CameraFrame{0, Instant{}, std::move(image)}).tags;
}

void expect_read(TagDetector& detector, const TagFamily& family, int id, const PrintedTag& tag) {
  SCOPED_TRACE(std::string(family.facts().name) + " id " + std::to_string(id) + ", turned " +
               std::to_string(tag.quarter_turns));
  const auto tags = read(detector, photograph(family, id, tag));
  ASSERT_EQ(tags.size(), 1u);
  EXPECT_EQ(tags[0].tag_id, id);
  EXPECT_EQ(tags[0].hamming, 0);
  const auto truth = corners_of(family, tag);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT((tags[0].corners_px[i] - truth[i]).norm(), kCorner_px) << "corner " << i;
  for (const TagSide& side : tags[0].sides) EXPECT_GT(side.sharpness, 0.9);
}

TEST(TagFamily, WhatIsPrintedIsReadInAllFourTurns) {
  for (const TagFamilyFacts& facts : tag_families()) {
    const std::string name(facts.name);
    const auto family = TagFamily::named(name);
    ASSERT_TRUE(family) << name;
    EXPECT_EQ(family->edge_width(), facts.edge_cells) << name;
    TagDetector detector({.family = name}, {});
    PrintedTag tag;
    for (const int id : sampled_ids(*family)) {
      for (tag.quarter_turns = 0; tag.quarter_turns < 4; ++tag.quarter_turns)
        expect_read(detector, *family, id, tag);
      tag.offset_px += Eigen::Vector2d(0.25, 0.75);
    }
  }
}

/// Families of few bits in which some prints are mirror images of others.
bool has_mirror_images(std::string_view family) {
  return family.starts_with("DICT_4X4") || family == "DICT_ARUCO_ORIGINAL";
}

TEST(TagFamily, AMirroredPrintIsNotReadWhereBitsAreEnough) {
  for (const TagFamilyFacts& facts : tag_families()) {
    if (has_mirror_images(facts.name)) continue;
    const auto family = TagFamily::named(std::string(facts.name));
    TagDetector detector({.family = std::string(facts.name)}, {});
    for (const int id : sampled_ids(*family)) {
      EXPECT_TRUE(read(detector, photograph(*family, id, {.mirrored = true})).empty())
          << facts.name << " id " << id;
    }
  }
}

TEST(TagFamily, APrintThatLooksTheSameTurnedIsNeitherPrintedNorRead) {
  int found = 0;
  for (const TagFamilyFacts& facts : tag_families()) {
    const auto family = TagFamily::named(std::string(facts.name));
    for (int id = 0; id < family->ids(); ++id) {
      if (family->has_pose(id)) continue;
      ++found;
      EXPECT_EQ(facts.name, "DICT_ARUCO_ORIGINAL");
      EXPECT_THAT(family->fault_of(id), HasSubstr("looks the same when rotated"));
    }
  }
  EXPECT_EQ(found, 1);
}

TEST(TagFamily, NamesItsIds) {
  const auto family = TagFamily::named("tag16h5");
  EXPECT_EQ(family->fault_of(29), "");
  EXPECT_EQ(family->fault_of(30), "tag16h5 has the ids 0 to 29");
  EXPECT_NE(family->fault_of(-1), "");
}

TEST(TagFamily, IsFoundByAnyOfItsSpellings) {
  for (const char* name : {"DICT_4X4_50", "dict_4x4_50", "aruco_4x4_50", "ArUco 4x4-50", "4x4_50",
                           "DICT_ARUCO_4X4_50"})
    EXPECT_EQ(listed_tag_family(name), "DICT_4X4_50") << name;
  EXPECT_EQ(listed_tag_family("TAG36H11"), "tag36h11");
  EXPECT_EQ(listed_tag_family("aruco_original"), "DICT_ARUCO_ORIGINAL");
  EXPECT_EQ(listed_tag_family("apriltag_36h11"), "DICT_APRILTAG_36h11");
  EXPECT_EQ(listed_tag_family("Tag99"), "Tag99");
}

TEST(TagFamily, AnUnknownOneIsRefusedNamingTheKnownAndWhatMayBeMeant) {
  const auto family = TagFamily::named("tag36h1");
  ASSERT_FALSE(family);
  EXPECT_THAT(family.error().what, HasSubstr("tag36h11, tag36h10"));
  EXPECT_THAT(family.error().what, HasSubstr("did you mean tag36h1"));
  EXPECT_THAT(tag_family_rule("DICT_4X5_50"), HasSubstr("did you mean DICT_4X4_50?"));
  EXPECT_FALSE(is_tag_family("tag99"));
  EXPECT_TRUE(is_tag_family("tag36h11"));
}

TEST(TagFamily, OneOfFewBitsIsWarnedAbout) {
  for (const char* name : {"tag16h5", "DICT_4X4_50", "DICT_4X4_1000", "DICT_ARUCO_ORIGINAL"})
    EXPECT_THAT(tag_family_warning(name), HasSubstr("prefer tag36h11")) << name;
  for (const char* name : {"tag36h11", "tag25h9", "tagStandard41h12", "DICT_6X6_250"})
    EXPECT_EQ(tag_family_warning(name), "") << name;
}

}  // namespace
}  // namespace fiducap
