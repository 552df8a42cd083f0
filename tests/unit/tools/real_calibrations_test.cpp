// Real boards and a real field video, each with the calibration that its authors made. Prints the
// second table of docs/design/intrinsics.md.
#include <gmock/gmock.h>

#include <filesystem>
#include <iostream>

#include <nlohmann/json.hpp>

#include "support/command_run.hpp"
#include "support/shared_data.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

struct RealRow {
  std::string name;
  CalibrateCameraArguments arguments;  ///< Paths below the recordings.
  double fu{}, fv{};                   ///< By the authors.
  std::string verdict;
  std::string why;     ///< Part of one sentence of advice.
  double most_off{0};  ///< Of the focal lengths against theirs, relative; 0: not compared.
};

CalibrateCameraArguments corners(const std::string& file, const std::string& set, int camera,
                                 const std::string& board, const std::string& size) {
  return {.input = {},
          .corners = file,
          .board = board,
          .size = size,
          .set = set,
          .checkerboard = {},
          .camera = camera};
}
CalibrateCameraArguments video(const std::string& file, bool loose, const std::string& lens) {
  return {.input = file, .checkerboard = {}, .lens = lens, .loose = loose};
}

class RealCalibrations : public VerbTest<CalibrateCameraArguments>,
                         public ::testing::WithParamInterface<RealRow> {};

void print_real_row(const RealRow& row, const nlohmann::json& r) {
  const auto& fu = r["numbers"]["fu"];
  const auto& fv = r["numbers"]["fv"];
  std::cout << "| " << row.name << " | " << r["images"]["used"] << ", "
            << std::lround(100 * r["covered"].get<double>()) << " % | " << row.fu << ", " << row.fv
            << " | " << fu["value"].get<double>() << " ± " << fu["sigma"].get<double>() << ", "
            << fv["value"].get<double>() << " | " << r["lens"].get<std::string>() << ", "
            << r["numbers"].size() << " | " << r["reprojection_rms_px"].get<double>() << " | "
            << r["verdict"].get<std::string>() << " | ";
  for (const auto& advice : r["advice"]) std::cout << advice.get<std::string>() << " ";
  std::cout << "|\n    " << r["checks"].dump() << "\n";
}

TEST_P(RealCalibrations, GetTheExpectedVerdict) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  const RealRow& row = GetParam();
  arguments_ = row.arguments;
  for (std::string* path : {&arguments_.input, &arguments_.corners})
    if (!path->empty()) *path = (*data / *path).string();
  arguments_.out = folder_.file("out");
  arguments_.json = true;
  const bool usable = row.verdict != "useless" && row.verdict != "error";
  run(run_calibrate_camera, usable ? kExitOk : kExitFailed);
  EXPECT_EQ(std::filesystem::exists(folder_.file("out/camera.yaml")), usable);
  if (out_.empty()) {
    std::cout << "| " << row.name << " | error | " << err_;
    EXPECT_EQ(row.verdict, "error") << err_;
    EXPECT_THAT(err_, ::testing::HasSubstr(row.why));
    return;
  }
  const auto report = nlohmann::json::parse(out_);
  print_real_row(row, report);
  EXPECT_EQ(report["verdict"], row.verdict) << report["advice"];
  EXPECT_THAT(report["advice"].dump(), ::testing::HasSubstr(row.why));
  if (row.most_off == 0) return;
  EXPECT_NEAR(report["numbers"]["fu"]["value"].get<double>() / row.fu, 1, row.most_off);
  EXPECT_NEAR(report["numbers"]["fv"]["value"].get<double>() / row.fv, 1, row.most_off);
}

std::vector<RealRow> real_rows() {
  const std::string wpical = "detector/wpical/fieldvideo_long.mp4";
  const std::string caliscope = "outside_in/caliscope/corners.csv";
  const std::string points =
      "outside_in/caliscope/post_optimization/calibration/extrinsic/CHARUCO/xy_CHARUCO.csv";
  const std::string ros = "outside_in/rosindustrial_charuco/corners.csv";
  const std::string fairo = "outside_in/fairo_eyehandcal/corners.csv";
  const std::string board = "charuco:4x5:54:40.5";
  std::vector<RealRow> rows;
  const auto field = [&](const char* name, bool loose, const char* lens) {
    rows.push_back({name, video(wpical, loose, lens), 1826.1, 1821.5, "useless", "known to"});
  };
  field("field video, as it is", false, "auto");
  field("field video, tags by themselves", true, "auto");
  field("field video, tags by themselves, equidistant", true, "equidistant");
  const double f[4][2] = {{903.6, 907.9}, {760.3, 761.0}, {650.8, 654.5}, {639.9, 639.5}};
  for (int k = 0; k < 4; ++k) {
    const std::string camera = "caliscope camera " + std::to_string(k);
    // Only the first camera has the board in a quarter of its image; its focus differs, see the
    // design page.
    rows.push_back({camera + ", ChArUco markers",
                    corners(caliscope, "charuco_calibration", k, board, "1280x720"), f[k][0],
                    f[k][1], k == 0 ? "weak" : "useless", "of the image was seen",
                    k == 0 ? 0.05 : 0});
    if (k < 2)
      rows.push_back({camera + ", chessboard points",
                      corners(points, "", k, "points:3x4:54", "1280x720"), f[k][0], f[k][1],
                      "useless", "of the image was seen", 0.05});
  }
  rows.push_back({"rosindustrial, ChArUco markers",
                  corners(ros, "", 0, "charuco:5x7:36.195:18.256", "1600x1200"), 1352.0, 1356.1,
                  "weak", "is bent by about", 0.02});
  const double g[3][2] = {{601.4, 600.1}, {617.3, 617.3}, {612.9, 613.4}};
  for (int k = 0; k < 3; ++k)
    rows.push_back({"fairo camera " + std::to_string(k) + ", tags on an arm",
                    corners(fairo, "jpeg", k, "tags:40", "640x480"), g[k][0], g[k][1],
                    k == 0 ? "useless" : "error", k == 0 ? "known to" : "too few data"});
  return rows;
}

INSTANTIATE_TEST_SUITE_P(Real, RealCalibrations, ::testing::ValuesIn(real_rows()),
                         [](const ::testing::TestParamInfo<RealRow>& row) {
                           std::string name = row.param.name;
                           for (char& c : name)
                             if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
                           return name;
                         });

}  // namespace
}  // namespace fiducap
