#include "detection/april_grid.hpp"

#include <gtest/gtest.h>

#include "detection/tag_detector.hpp"
#include "unit/detection/drawn_grid.hpp"

namespace fiducap {
namespace {

// Of a drawn and slightly blurred grid: the saddle points are symmetrical.
constexpr double kCorner_px = 0.1;

class AprilGridTest : public testing::TestWithParam<DrawnGrid> {};

INSTANTIATE_TEST_SUITE_P(Grids, AprilGridTest,
                         testing::Values(DrawnGrid{}, DrawnGrid{.gap_cells = 2, .cell_px = 5},
                                         DrawnGrid{.columns = 4, .rows = 3, .gap_cells = 5},
                                         DrawnGrid{.columns = 7, .rows = 5, .first_id = 551},
                                         DrawnGrid{.columns = 3, .rows = 2, .cell_px = 12}));

TEST_P(AprilGridTest, AllTagsAreFoundWithTheirCorners) {
  const DrawnGrid grid = GetParam();
  constexpr int kMargin_px = 30;
  GrayImage image = white_wall(grid.width_px() + 2 * kMargin_px, grid.height_px() + 2 * kMargin_px);
  grid.draw(image, kMargin_px, kMargin_px);
  blur(image, 2, 2);  // moves edges by half a pixel to the left and up
  AprilGridSearch search;
  const auto tags = search.find(image);
  ASSERT_EQ(tags.size(), static_cast<std::size_t>(grid.columns * grid.rows));
  const double size_px = DrawnGrid::kTagCells * grid.cell_px;
  for (int i = 0; i < grid.columns * grid.rows; ++i) {
    const TagSighting& tag = tags[static_cast<std::size_t>(i)];
    EXPECT_EQ(tag.tag_id, grid.first_id + i);
    constexpr double kEdge_px = -0.5 - 0.5;  // from centres of pixels, and the blur
    const double left = kMargin_px + grid.left_px(i % grid.columns) + kEdge_px;
    const double top = kMargin_px + grid.top_px(i / grid.columns) + kEdge_px;
    const std::array<Eigen::Vector2d, 4> truth{{{left, top + size_px},
                                                {left + size_px, top + size_px},
                                                {left + size_px, top},
                                                {left, top}}};
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_LT((tag.corners_px[k] - truth[k]).norm(), kCorner_px)
          << "tag " << i << " corner " << k;
    EXPECT_GT(tag.sharpness, 0.5);
  }
}

TEST(AprilGrid, IsNoGridOfUsualTags) {
  GrayImage image = white_wall();
  draw_tag(image, 7, 100, 100, 8);
  AprilGridSearch search;
  EXPECT_TRUE(search.find(image).empty());
  EXPECT_TRUE(search.find(white_wall(3, 3)).empty());
  DrawnGrid grid{.columns = 3, .rows = 2};
  grid.draw(image, 300, 100);
  TagDetector usual({}, {});
  const auto tags = usual.detect({0, {}, std::make_shared<const GrayImage>(image)}).tags;
  ASSERT_EQ(tags.size(), 1u) << "only the usual one";
  EXPECT_EQ(tags[0].tag_id, 7);
}

}  // namespace
}  // namespace fiducap
