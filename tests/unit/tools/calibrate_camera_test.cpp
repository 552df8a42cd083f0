#include "tools/calibrate/calibrate.hpp"

#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "capture/gray_image.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_writer.hpp"
#include "support/temporary_folder.hpp"
#include "unit/calibration/calibration_scene.hpp"
#include "unit/simulation/still_camera.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr double kSigmas =
    4;  // eight numbers and their correlations: 4 sigma of one is 3.3 of the worst

/// Six tags on a board, photographed.
class CalibrateCamera : public ::testing::TestWithParam<Distortion> {
 protected:
  CameraModel truth() const {
    return GetParam() == Distortion::kEquidistant ? fisheye_lens() : narrow_lens();
  }

  static std::vector<RecordedTag> board() {
    std::vector<RecordedTag> tags;
    for (int i = 0; i < 6; ++i) {
      RecordedTag tag;
      tag.tag_id = 10 + i;
      tag.edge_m = 0.1;
      tag.X_WT.p = {0.15 * (i % 3 - 1), 0.15 * (i / 3 - 0.5), 0};
      tags.push_back(tag);
    }
    return tags;
  }

  void photograph(const CameraModel& camera, int images, double reach, double tilt_rad) {
    simulation::CameraSimulation settings;
    settings.pixel_noise = 2;
    settings.exposure_s = exposure_s_;
    simulation::StillCamera photographer(camera, settings);
    CalibrationScene scene(camera, 3);
    const auto tags = board();
    std::filesystem::create_directories(pictures_);
    std::vector<std::uint8_t> scratch;
    for (int i = 0; i < images; ++i) {
      const Pose X_WV = scene.board_pose(reach, tilt_rad).inverse();
      const auto image = photographer.photograph(
          simulation::EvenMotion(X_WV, Eigen::Vector3d::Zero(),
                                 blur_rad_s_ * Eigen::Vector3d(std::sin(i), std::cos(i), 0.3)),
          tags, static_cast<std::uint64_t>(i));
      const std::string name = std::to_string(1000 + i) + ".png";
      ASSERT_TRUE(write_gray_file(std::filesystem::path(pictures_) / name, scratch, *image));
    }
  }

  int calibrate() {
    arguments_.input = pictures_;
    arguments_.tag_mm = 100;
    arguments_.out = folder_.file("out");
    arguments_.json = true;
    return run_calibrate_camera(arguments_, {out_, err_});
  }

  TemporaryFolder folder_;
  std::string pictures_{folder_.file("pictures")};
  double blur_rad_s_{0};  ///< How fast the camera turns, and …
  double exposure_s_{0.005};
  CalibrateCameraArguments arguments_;
  std::ostringstream out_;
  std::ostringstream err_;
};

INSTANTIATE_TEST_SUITE_P(Rendered, CalibrateCamera,
                         ::testing::Values(Distortion::kRadialTangential,
                                           Distortion::kEquidistant));

TEST_P(CalibrateCamera, FindsTheLensOfRenderedPicturesWithinItsOwnUncertainty) {
  photograph(truth(), 70, 0.95, 0.8);
  ASSERT_EQ(calibrate(), kExitOk) << err_.str();
  const auto report = nlohmann::json::parse(out_.str());
  EXPECT_EQ(report["lens"],
            GetParam() == Distortion::kEquidistant ? "equidistant" : "radial-tangential");
  EXPECT_NE(report["verdict"], "useless") << report["advice"];
  EXPECT_EQ(report["targets_stood_still"], true);
  const CameraModel camera = truth();
  const auto& k = camera.coefficients;
  const bool fisheye = GetParam() == Distortion::kEquidistant;
  const std::map<std::string, double> expected{{"fu", camera.fu},
                                               {"fv", camera.fv},
                                               {"cu", camera.cu},
                                               {"cv", camera.cv},
                                               {"k1", k[0]},
                                               {"k2", k[1]},
                                               {fisheye ? "k3" : "p1", k[2]},
                                               {fisheye ? "k4" : "p2", k[3]}};
  for (const auto& [name, value] : expected) {
    const double sigma = report["numbers"][name]["sigma"];
    EXPECT_NEAR(report["numbers"][name]["value"], value, kSigmas * sigma) << name;
    EXPECT_GT(sigma, 0) << name;
  }
  EXPECT_LT(report["numbers"]["fu"]["sigma"], 0.5);  // and that is not by being modest
}

TEST_P(CalibrateCamera, WritesTheFileThatTheConfigurationReadsAndAPage) {
  photograph(truth(), 40, 0.95, 0.8);
  ASSERT_EQ(calibrate(), kExitOk) << err_.str();
  const auto read = read_camera_calibration(folder_.file("out") + "/camera.yaml");
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->distortion, GetParam());
  EXPECT_EQ(read->width, 752);
  const auto report = nlohmann::json::parse(out_.str());
  constexpr double kText_px = 1e-5;  // six decimals
  EXPECT_NEAR(read->fu, report["numbers"]["fu"]["value"], kText_px);
  EXPECT_NEAR(read->cv, report["numbers"]["cv"]["value"], kText_px);
  EXPECT_NEAR(read->coefficients[1], report["numbers"]["k2"]["value"], 1e-8);
  const auto page = read_whole_file(folder_.file("out") + "/camera.html");
  ASSERT_TRUE(page);
  EXPECT_THAT(*page, HasSubstr("Coverage"));
  EXPECT_THAT(*page, HasSubstr("Reprojection"));
}

TEST_P(CalibrateCamera, ABoardInTheMiddleThatIsNeverTiltedIsNotCalledGood) {
  photograph(truth(), 40, 0.2, 0.0);
  const int code = calibrate();
  if (code == kExitOk) {
    const auto report = nlohmann::json::parse(out_.str());
    EXPECT_EQ(report["verdict"], "weak");
    EXPECT_FALSE(report["advice"].empty());
  } else {
    EXPECT_FALSE(std::filesystem::exists(folder_.file("out") + "/camera.yaml"));
    EXPECT_FALSE(err_.str().empty());
  }
}

using CalibrateCameraInput = CalibrateCamera;
INSTANTIATE_TEST_SUITE_P(Input, CalibrateCameraInput,
                         ::testing::Values(Distortion::kRadialTangential));

TEST_P(CalibrateCameraInput, ThreePicturesAreTooFew) {
  photograph(truth(), 3, 0.5, 0.8);
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("too few data"));
}

TEST_P(CalibrateCameraInput, AFolderWithoutPicturesSaysWhatWasExpected) {
  std::filesystem::create_directories(pictures_);
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("holds neither pictures"));
}

TEST_P(CalibrateCameraInput, AFileThatDoesNotExistIsNamed) {
  arguments_.out = folder_.file("out");
  arguments_.input = folder_.file("nothing.mp4");
  EXPECT_EQ(run_calibrate_camera(arguments_, {out_, err_}), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("nothing.mp4"));
}

TEST_P(CalibrateCameraInput, PicturesWithoutATagSaySo) {
  photograph(truth(), 6, 0.5, 0.8);
  arguments_.family = "tag25h9";
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("no tag of 20 px"));
}

TEST_P(CalibrateCameraInput, WhatIsRefusedIsWrittenOnlyByForce) {
  photograph(truth(), 12, 0.1, 0.05);
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("--force"));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("out") + "/camera.yaml"));
  EXPECT_EQ(nlohmann::json::parse(out_.str())["verdict"], "useless");
  arguments_.force = true;
  out_.str("");
  EXPECT_EQ(calibrate(), kExitOk);
  const auto file = read_whole_file(folder_.file("out") + "/camera.yaml");
  ASSERT_TRUE(file);
  EXPECT_THAT(*file, HasSubstr("verdict: useless"));
  EXPECT_THAT(*file, HasSubstr("intrinsics_sigma: {focal: "));
  EXPECT_TRUE(read_camera_calibration(folder_.file("out") + "/camera.yaml"));
}

TEST_P(CalibrateCameraInput, CornersNeedTheSizeOfTheirImages) {
  arguments_.corners = folder_.write("corners.csv", "image,tag,corner,u,v\n");
  arguments_.input.clear();
  for (const char* wrong : {"", "640", "640x", "x480", "640x480x3", "0x480"}) {
    err_.str("");
    arguments_.size = wrong;
    EXPECT_EQ(run_calibrate_camera(arguments_, {out_, err_}), kExitFailed) << wrong;
    EXPECT_THAT(err_.str(), HasSubstr("--size")) << wrong;
  }
}

TEST_P(CalibrateCameraInput, BlurredPicturesAreNotCalledGood) {
  blur_rad_s_ = 1.5;
  exposure_s_ = 0.02;
  photograph(truth(), 40, 0.95, 0.8);
  const int code = calibrate();
  if (code != kExitOk) return;
  EXPECT_NE(nlohmann::json::parse(out_.str())["verdict"], "good");
}

TEST_P(CalibrateCameraInput, AnUnknownFamilyIsRefused) {
  photograph(truth(), 1, 0.5, 0.8);
  arguments_.family = "tag99h99";
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("family"));
}

TEST_P(CalibrateCameraInput, PicturesOfTwoSizesAreRefused) {
  photograph(truth(), 2, 0.5, 0.8);
  GrayImage other;
  other.resize(100, 80);
  std::vector<std::uint8_t> scratch;
  ASSERT_TRUE(write_gray_file(pictures_ + "/9999.png", scratch, other));
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("100 x 80"));
}

TEST_P(CalibrateCameraInput, ADamagedPictureIsLeftOut) {
  photograph(truth(), 40, 0.95, 0.8);
  std::ofstream(pictures_ + "/0000.png") << "no picture";
  ASSERT_EQ(calibrate(), kExitOk) << err_.str();
  EXPECT_EQ(nlohmann::json::parse(out_.str())["images"]["looked_at"], 40);
}

TEST_P(CalibrateCameraInput, ACheckerboardIsGivenByItsInnerCorners) {
  photograph(truth(), 1, 0.5, 0.8);
  for (const char* wrong : {"9", "9x", "x6", "9x6x2", "2x9", "9x-6", "nine"}) {
    err_.str("");
    arguments_.checkerboard = wrong;
    EXPECT_EQ(calibrate(), kExitFailed) << wrong;
    EXPECT_THAT(err_.str(), HasSubstr("inner corners")) << wrong;
  }
}

TEST_P(CalibrateCameraInput, ACheckerboardThatIsNotThereIsSaidSo) {
  photograph(truth(), 3, 0.5, 0.8);
  arguments_.checkerboard = "9x6";
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("no whole checkerboard of 9x6"));
}

/// Squares averaged over 4 × 4 places of each pixel.
GrayImage checkerboard_picture(const CameraModel& camera, const Pose& X_VB, int columns, int rows,
                               double square_m) {
  GrayImage image;
  image.resize(camera.width, camera.height);
  const Pose X_BV = X_VB.inverse();
  const auto gray = [&](double u, double v) {
    const auto ideal = undistort(camera, {u, v}, 1.5);
    if (!ideal) return 90.0;
    const Eigen::Vector3d ray =
        X_BV.q * Eigen::Vector3d((ideal->px.x() - camera.cu) / camera.fu,
                                 (ideal->px.y() - camera.cv) / camera.fv, 1);
    const Eigen::Vector3d p = X_BV.p - X_BV.p.z() / ray.z() * ray;
    const double x = p.x() / square_m + columns / 2.0 + 0.5;
    const double y = p.y() / square_m + rows / 2.0 + 0.5;
    const bool on_squares = x > 0 && y > 0 && x < columns + 1 && y < rows + 1;
    const bool on_paper = x > -1 && y > -1 && x < columns + 2 && y < rows + 2;
    if (!on_squares) return on_paper ? 220.0 : 90.0;
    return (static_cast<int>(x) + static_cast<int>(y)) % 2 == 0 ? 30.0 : 220.0;
  };
  std::vector<double> corners;  // of pixels: where all four agree, so does what is between
  for (int v = 0; v <= camera.height; ++v)
    for (int u = 0; u <= camera.width; ++u) corners.push_back(gray(u - 0.5, v - 0.5));
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const double* upper = corners.data() + v * (camera.width + 1) + u;
      const double* lower = upper + camera.width + 1;
      double sum = 16 * upper[0];
      if (upper[1] != upper[0] || lower[0] != upper[0] || lower[1] != upper[0]) {
        sum = 0;
        for (int k = 0; k < 16; ++k) sum += gray(u + (k % 4 - 1.5) / 4, v + (k / 4 - 1.5) / 4);
      }
      image.pixels[static_cast<std::size_t>(v * camera.width + u)] =
          static_cast<std::uint8_t>(sum / 16 + 0.5);
    }
  return image;
}

TEST_P(CalibrateCamera, ACheckerboardDoesAsWell) {
  CameraModel camera = truth();  // half the size: the pictures are drawn slowly
  camera.width = 376;
  camera.height = 240;
  camera.fu /= 2;
  camera.fv /= 2;
  camera.cu = camera.cu / 2 - 0.25;
  camera.cv = camera.cv / 2 - 0.25;
  CalibrationScene scene(camera, 5);
  std::filesystem::create_directories(pictures_);
  std::vector<std::uint8_t> scratch;
  for (int i = 0; i < 40; ++i) {
    const Pose X_VB = scene.board_pose(0.7, 0.8);
    ASSERT_TRUE(write_gray_file(pictures_ + "/" + std::to_string(100 + i) + ".png", scratch,
                                checkerboard_picture(camera, X_VB, 7, 5, 0.03)));
  }
  arguments_.checkerboard = "7x5";
  arguments_.lens = GetParam() == Distortion::kEquidistant ? "equidistant" : "radial-tangential";
  ASSERT_EQ(calibrate(), kExitOk) << err_.str();
  const auto report = nlohmann::json::parse(out_.str());
  EXPECT_GT(report["images"]["used"], 15);
  for (const auto& [name, value] : std::map<std::string, double>{
           {"fu", camera.fu}, {"fv", camera.fv}, {"cu", camera.cu}, {"cv", camera.cv}}) {
    const double sigma = report["numbers"][name]["sigma"];
    EXPECT_NEAR(report["numbers"][name]["value"], value, kSigmas * sigma) << name;
    EXPECT_LT(sigma, 1.0) << name;
  }
}

}  // namespace
}  // namespace fiducap
