#include <gmock/gmock.h>

#include "base/text.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

class CornerFile : public ::testing::Test {
 protected:
  [[nodiscard]] Expected<CalibrationData> read(const std::string& text,
                                               const std::string& board = "tags:100",
                                               const std::string& set = "", int camera = 0) const {
    CornerFileChoice choice;
    choice.path = folder_.write("corners.csv", text);
    choice.width = 640;
    choice.height = 480;
    choice.camera = camera;
    choice.set = set;
    const auto described = read_board_description(board);
    if (!described) return tl::unexpected(described.error());
    choice.board = *described;
    return read_corner_file(choice);
  }
  /// Rows of four corners of one tag.
  [[nodiscard]] Expected<CalibrationData> read_tags(const std::string& rows,
                                                    const std::string& board = "tags:100") const {
    return read("image,tag,blx,bly,brx,bry,trx,try,tlx,tly\n" + rows, board);
  }

  TemporaryFolder folder_;
};

TEST_F(CornerFile, HasTagsCornerByCornerWithColumnsInAnyOrder) {
  const auto data = value_of(
      read("u,v,corner,tag,image,note\n"
           "10,60,0,7,first,x\n60,60,1,7,first,x\n60,10,2,7,first,x\n10,10,3,7,first,x\n"));
  ASSERT_EQ(data.views.size(), 1U);
  EXPECT_EQ(data.views[0].name, "first");
  ASSERT_EQ(data.views[0].sightings.size(), 1U);
  EXPECT_EQ(data.targets[0].name, "tag 7");
  EXPECT_EQ(data.views[0].sightings[0].points[1].px, Eigen::Vector2d(60, 60));
  EXPECT_DOUBLE_EQ((data.targets[0].points[1] - data.targets[0].points[0]).norm(), 0.1);
}

TEST_F(CornerFile, HasRowsOfFourCornersOfOneCameraAndSet) {
  const std::string text =
      "set,frame,cam,id,blx,bly,brx,bry,trx,try,tlx,tly\n"
      "a,0,0,3,10,60,60,60,60,10,10,10\n"
      "b,0,0,3,11,60,60,60,60,10,10,10\n"
      "a,1,1,3,12,60,60,60,60,10,10,10\n";
  EXPECT_THAT(error_of(read(text)), HasSubstr("sets a, b: choose one with --set"));
  const auto data = value_of(read(text, "tags:100", "a", 1));
  ASSERT_EQ(data.views.size(), 1U);
  EXPECT_EQ(data.views[0].sightings[0].points[0].px.x(), 12);
}

TEST_F(CornerFile, HasBoardPointsNumberedRowByRow) {
  std::string text = "image,point,u,v\n";
  for (int i = 0; i < 6; ++i)
    text += "1," + std::to_string(i) + "," + std::to_string(100 + 20 * i) + ",50\n";
  const auto data = value_of(read(text, "points:3x2:20"));
  EXPECT_EQ(data.targets[0].points.size(), 6U);
  EXPECT_EQ(data.targets[0].points[4], Eigen::Vector3d(0.02, -0.02, 0));
}

TEST(BoardDescription, CharucoMarkersAreOnWhiteSquares) {
  const auto middle = [](const BoardDescription& board, int tag) {
    const auto first = static_cast<std::size_t>(board.first_corner_of_tag.at(tag));
    return Eigen::Vector3d((board.board.points[first] + board.board.points[first + 2]) / 2);
  };
  constexpr double kRounding = 1e-12;
  const auto black = value_of(read_board_description("charuco:3x2:30:20"));
  // b w b / w b w, from the upper left
  ASSERT_EQ(black.first_corner_of_tag.size(), 3U);
  EXPECT_LT((middle(black, 0) - Eigen::Vector3d(0.045, -0.015, 0)).norm(), kRounding);
  EXPECT_LT((middle(black, 1) - Eigen::Vector3d(0.015, -0.045, 0)).norm(), kRounding);
  const auto white = value_of(read_board_description("charuco:3x2:30:20:white"));
  EXPECT_LT((middle(white, 0) - Eigen::Vector3d(0.015, -0.015, 0)).norm(), kRounding);
}

TEST(BoardDescription, RefusesImpossibleBoards) {
  for (const char* wrong : {"", "tags", "tags:0", "tags:nan", "points:9:20", "points:9x6",
                            "charuco:5x7:20:30", "charuco:5x7:36:18:black", "grid:1x2:30:10",
                            "points:900x6:20", "grid:3x3:-3:10", "x:3x3:1"})
    EXPECT_THAT(error_of(read_board_description(wrong)), HasSubstr("--board")) << wrong;
}

TEST_F(CornerFile, OmitsTagsThatAreNotOnTheBoard) {
  const std::string rows =
      "1,0,10,60,60,60,60,10,10,10\n1,1,110,60,160,60,160,10,110,10\n"
      "1,99,210,60,260,60,260,10,210,10\n";
  EXPECT_THAT(error_of(read_tags(rows, "grid:2x1:30:10")), HasSubstr("--board"))
      << "one row of tags is no board";
  EXPECT_EQ(value_of(read_tags(rows, "grid:2x2:30:10")).views[0].sightings[0].points.size(), 8U);
}

TEST_F(CornerFile, RefusesMirroredImages) {
  EXPECT_THAT(error_of(read_tags("1,0,60,60,10,60,10,10,60,10\n2,0,70,60,10,60,10,10,70,10\n")),
              HasSubstr("mirrored"));
}

TEST_F(CornerFile, OmitsUnusableRows) {
  const auto data = value_of(read_tags(
      "1,0,nan,60,60,60,60,10,10,10\n1,1,10,60,60\n1,2,1e9,60,60,60,60,10,10,10\n"
      "1,3,10,60,60,60,60,10,10,10\n1,3,11,60,60,60,60,10,10,10\n1,-4,10,60,60,60,60,10,10,10\n"));
  ASSERT_EQ(data.views[0].sightings.size(), 1U);
  EXPECT_EQ(data.views[0].sightings[0].points[0].px.x(), 10);
}

TEST_F(CornerFile, ErrorNamesWhatIsMissing) {
  EXPECT_THAT(error_of(read("")), HasSubstr("is empty"));
  EXPECT_THAT(error_of(read("1,2,3\n")), HasSubstr("column names: image,tag,corner,u,v"));
  EXPECT_THAT(error_of(read("image,tag,corner,u,v\n", "points:3x3:20")),
              HasSubstr("image,point,u,v"));
  EXPECT_THAT(error_of(read("image,tag,corner,u,v\n")), HasSubstr("no corners"));
}

}  // namespace
}  // namespace fiducap
