#include <gmock/gmock.h>

#include <filesystem>

#include <nlohmann/json.hpp>

#include "support/command_run.hpp"
#include "support/results.hpp"
#include "tools/calibrate/calibrate.hpp"
#include "unit/calibration/calibration_scene.hpp"
#include "unit/detection/drawn_grid.hpp"

namespace fiducap {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kTag_m = 0.055;
// Eight numbers and their correlations: 4 sigma of one is 3.3 of the worst.
constexpr double kGridSigmas = 4;

/// Photographs a flat print through a lens, without noise.
class PrintPhotographer final {
 public:
  PrintPhotographer(const CameraModel& camera, const DrawnGrid& grid)
      : camera_(camera),
        print_(white_wall(grid.width_px() + 2 * kMargin, grid.height_px() + 2 * kMargin)),
        texel_m_(kTag_m / (DrawnGrid::kTagCells * grid.cell_px)) {
    grid.draw(print_, kMargin, kMargin);
    for (int k = 0; k < camera.width * camera.height * kFine * kFine; ++k) {
      const int u = k % (camera.width * kFine);
      const int v = k / (camera.width * kFine);
      const Eigen::Vector2d px((u + 0.5) / kFine - 0.5, (v + 0.5) / kFine - 0.5);
      const auto ideal = undistort(camera, px);
      rays_.push_back(ideal ? Eigen::Vector3d((ideal->px.x() - camera.cu) / camera.fu,
                                              (ideal->px.y() - camera.cv) / camera.fv, 1)
                            : Eigen::Vector3d::Zero());
    }
  }

  GrayImage photograph(const Pose& X_VB) const {
    GrayImage image;
    image.resize(camera_.width, camera_.height);
    std::vector<int> sums(image.pixels.size());
    const Eigen::Matrix3d R_BV = X_VB.rotation().transpose();
    const Eigen::Vector3d p_BV = R_BV * X_VB.p;
    const int width = camera_.width * kFine;
    for (int k = 0; k < static_cast<int>(rays_.size()); ++k) {
      const Eigen::Vector3d ray = R_BV * rays_[static_cast<std::size_t>(k)];
      const Eigen::Vector3d at_B = ray * (p_BV.z() / ray.z()) - p_BV;
      sums[static_cast<std::size_t>(k / width / kFine * camera_.width + k % width / kFine)] +=
          gray_at(at_B);
    }
    for (std::size_t i = 0; i < sums.size(); ++i)
      image.pixels[i] = static_cast<std::uint8_t>(sums[i] / (kFine * kFine));
    return image;
  }

 private:
  static constexpr int kMargin = 20;
  static constexpr int kFine = 2;

  [[nodiscard]] int gray_at(const Eigen::Vector3d& at_B) const {
    const double u = at_B.x() / texel_m_ + print_.width / 2.0;
    const double v = print_.height / 2.0 - at_B.y() / texel_m_;
    if (!(u >= 0 && v >= 0 && u < print_.width && v < print_.height)) return 120;
    return print_.pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(print_.width) +
                         static_cast<std::size_t>(u)];
  }

  CameraModel camera_;
  GrayImage print_;
  double texel_m_;
  std::vector<Eigen::Vector3d> rays_;
};

struct GridCase {
  DrawnGrid grid;
  CameraModel camera;
  std::string board;  ///< Content of target.yaml, or a description; empty: none.
};

CameraModel plain_lens() { return {400, 300, 312, 311, 203, 147, Distortion::kNone, {}}; }

class CalibrateGrid : public VerbTest<CalibrateCameraArguments> {
 protected:
  void photograph(const GridCase& one, int images) {
    const PrintPhotographer photographer(one.camera, one.grid);
    CalibrationScene scene(one.camera, 5);
    std::filesystem::create_directories(arguments_.input);
    for (int i = 0; i < images; ++i) {
      Pose X_VB = scene.board_pose(0.7, 0.8);
      X_VB.p *= 0.5;
      ASSERT_TRUE(write_gray_file(arguments_.input + "/" + std::to_string(100 + i) + ".png",
                                  scratch_, photographer.photograph(X_VB)));
    }
  }
  CalibrateGrid() {
    arguments_.input = folder_.file("pictures");
    arguments_.out = folder_.file("out");
    arguments_.json = true;
  }

  std::vector<std::uint8_t> scratch_;
};

class CalibrateGridTruth : public CalibrateGrid, public testing::WithParamInterface<GridCase> {};

INSTANTIATE_TEST_SUITE_P(
    Grids, CalibrateGridTruth,
    testing::Values(
        GridCase{{.columns = 6, .rows = 6}, plain_lens(), ""},
        GridCase{{.columns = 6, .rows = 6},
                 plain_lens(),
                 "target_type: 'aprilgrid' #gridtype\ntagCols: 6\ntagRows: 6\ntagSize: 0.055 #m\n"
                 "tagSpacing: 0.3 #ratio of space between tags to tagSize\ncodeOffset: 0\n"},
        GridCase{{.columns = 5, .rows = 4, .gap_cells = 2, .first_id = 30},
                 plain_lens(),
                 R"({"tagCols": 5, "tagRows": 4, "tagSize": 0.055, "tagSpacing": 0.2,
                     "codeOffset": 30})"},
        GridCase{{.columns = 5, .rows = 3, .gap_cells = 5}, plain_lens(), "aprilgrid:5x3:55:0.5"}));

TEST_P(CalibrateGridTruth, FindsTheLensWithinItsSigmas) {
  photograph(GetParam(), 24);
  const std::string& board = GetParam().board;
  arguments_.board = board.find('\n') == std::string::npos && board.find('{') != 0
                         ? board
                         : folder_.write("target.yaml", board);
  run(run_calibrate_camera);
  const auto report = nlohmann::json::parse(out_);
  const CameraModel camera = plain_lens();
  for (const auto& [name, value] : {std::pair("fu", camera.fu), std::pair("fv", camera.fv),
                                    std::pair("cu", camera.cu), std::pair("cv", camera.cv)}) {
    const double sigma = report["numbers"][name]["sigma"];
    EXPECT_NEAR(report["numbers"][name]["value"], value, kGridSigmas * sigma) << name;
    EXPECT_LT(sigma, 1) << name;
  }
}

TEST_F(CalibrateGrid, NeedsTheGridThatIsDescribed) {
  photograph({{.columns = 3, .rows = 2, .first_id = 20}, plain_lens(), ""}, 3);
  arguments_.board = "aprilgrid:3x2:55:0.3";
  EXPECT_THAT(refused(run_calibrate_camera),
              AllOf(HasSubstr("no tag of the AprilGrid of 20 px or more"),
                    HasSubstr("Kalibr's AprilGrid")));
}

TEST(KalibrTarget, RefusesWhatIsNoBoard) {
  const TemporaryFolder folder;
  const auto refusal = [&](const std::string& text) {
    return error_of(read_board(folder.write("target.yaml", text)));
  };
  const std::string grid = "target_type: aprilgrid\n";
  EXPECT_THAT(refusal("target_type: circlegrid\n"), HasSubstr("aprilgrid or checkerboard"));
  EXPECT_THAT(refusal("cameras: []\n"), HasSubstr("aprilgrid or checkerboard"));
  EXPECT_THAT(refusal(grid), AllOf(HasSubstr("tagCols"), HasSubstr("is missing")));
  EXPECT_THAT(refusal(grid + "tagCols: 6\ntagRows: 6\ntagSize: 0.088\ntagSpacing: 26\n"),
              HasSubstr("relative to tagSize"));
  EXPECT_THAT(refusal(grid + "tagCols: 0\ntagRows: 6\ntagSize: 0.088\ntagSpacing: 0.3\n"),
              HasSubstr("1 to 100"));
  EXPECT_THAT(refusal(grid + "tagCols: 30\ntagRows: 30\ntagSize: 0.088\ntagSpacing: 0.3\n"),
              HasSubstr("more ids than tag36h11 has"));
  EXPECT_THAT(refusal("target_type: checkerboard\ntargetCols: 8\ntargetRows: 6\n"
                      "rowSpacingMeters: 0.03\ncolSpacingMeters: 0.02\n"),
              HasSubstr("squares"));
  const auto board = value_of(read_board(folder.write(
      "target.yaml",
      "target_type: checkerboard\ntargetCols: 8\ntargetRows: 6\nrowSpacingMeters: 0.03\n"
      "colSpacingMeters: 0.03\n")));
  ASSERT_TRUE(board.checkerboard);
  EXPECT_EQ(board.checkerboard->columns, 8);
  EXPECT_EQ(board.checkerboard->rows, 6);
}

TEST(KalibrTarget, IsNumberedFromTheLowerLeft) {
  const auto board = value_of(read_board_description("aprilgrid:6x5:88:0.3"));
  constexpr double kRounding = 1e-12;
  const auto corner = [&](int id, int k) {
    return board.board.points[static_cast<std::size_t>(board.first_corner_of_tag.at(id) + k)];
  };
  EXPECT_EQ(board.first_corner_of_tag.size(), 30U);
  EXPECT_LT((corner(1, 0) - corner(0, 0) - Eigen::Vector3d(0.1144, 0, 0)).norm(), kRounding);
  EXPECT_LT((corner(6, 0) - corner(0, 0) - Eigen::Vector3d(0, 0.1144, 0)).norm(), kRounding);
  EXPECT_LT((corner(7, 2) - corner(7, 0) - Eigen::Vector3d(0.088, 0.088, 0)).norm(), kRounding);
  for (const char* wrong :
       {"aprilgrid:6x6:88", "aprilgrid:6x6:88:0", "aprilgrid:6x6:88:x", "aprilgrid:90x90:88:0.3"})
    EXPECT_THAT(error_of(read_board_description(wrong)), HasSubstr("--board")) << wrong;
}

}  // namespace
}  // namespace fiducap
