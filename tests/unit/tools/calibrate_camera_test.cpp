#include <gmock/gmock.h>

#include <filesystem>
#include <limits>

#include <nlohmann/json.hpp>

#include "capture/gray_image.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_writer.hpp"
#include "support/command_run.hpp"
#include "support/results.hpp"
#include "tools/calibrate/calibrate.hpp"
#include "unit/calibration/calibration_scene.hpp"
#include "unit/simulation/still_camera.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

// Eight numbers and their correlations: 4 sigma of one is 3.3 of the worst.
constexpr double kSigmas = 4;

/// Six tags on a board, photographed.
class CalibrateCamera : public VerbTest<CalibrateCameraArguments>,
                        public ::testing::WithParamInterface<Distortion> {
 protected:
  CalibrateCamera() { arguments_.out = folder_.file("out"); }

  static bool fisheye() { return GetParam() == Distortion::kEquidistant; }
  static const char* lens() { return fisheye() ? "equidistant" : "radial-tangential"; }
  static CameraModel truth() { return fisheye() ? fisheye_lens() : narrow_lens(); }

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
  void save(const std::string& name, const GrayImage& image) {
    std::filesystem::create_directories(pictures_);
    ASSERT_TRUE(write_gray_file(pictures_ + "/" + name, scratch_, image));
  }
  void photograph(int images, double reach, double tilt_rad) {
    simulation::CameraSimulation settings;
    settings.pixel_noise = 2;
    simulation::StillCamera photographer(truth(), settings);
    CalibrationScene scene(truth(), 3);
    for (int i = 0; i < images; ++i) {
      const Pose X_WV = scene.board_pose(reach, tilt_rad).inverse();
      save(std::to_string(1000 + i) + ".png",
           *photographer.photograph(simulation::EvenMotion(X_WV), board(),
                                    static_cast<std::uint64_t>(i)));
    }
  }

  [[nodiscard]] std::string file(const std::string& name) const {
    return folder_.file("out/" + name);
  }
  void calibrate(int exit_code = kExitOk) {
    arguments_.input = pictures_;
    arguments_.tag_mm = 100;
    arguments_.json = true;
    run(run_calibrate_camera, exit_code);
  }
  [[nodiscard]] nlohmann::json report() const { return nlohmann::json::parse(out_); }
  void expect_refused(const std::string& reason) {
    calibrate(kExitFailed);
    EXPECT_THAT(err_, HasSubstr(reason));
  }
  void expect_numbers(const std::map<std::string, double>& expected, double most_sigma) const {
    for (const auto& [name, value] : expected) {
      const double sigma = report()["numbers"][name]["sigma"];
      EXPECT_NEAR(report()["numbers"][name]["value"], value, kSigmas * sigma) << name;
      EXPECT_GT(sigma, 0) << name;
      EXPECT_LT(sigma, most_sigma) << name;
    }
  }

  std::string pictures_{folder_.file("pictures")};
  std::vector<std::uint8_t> scratch_;
};

INSTANTIATE_TEST_SUITE_P(Rendered, CalibrateCamera,
                         ::testing::Values(Distortion::kRadialTangential,
                                           Distortion::kEquidistant));

TEST_P(CalibrateCamera, FindsTheLensWithinItsSigmasAndWritesIt) {
  photograph(70, 0.95, 0.8);
  folder_.write("pictures/0000.png", "no picture");
  calibrate();
  EXPECT_EQ(report()["images"]["looked_at"], 70) << "without the damaged one";
  EXPECT_EQ(report()["lens"], lens());
  EXPECT_NE(report()["verdict"], "useless") << report()["advice"];
  EXPECT_EQ(report()["targets_stood_still"], true);
  const CameraModel camera = truth();
  const auto& k = camera.coefficients;
  expect_numbers({{"fu", camera.fu},
                  {"fv", camera.fv},
                  {"cu", camera.cu},
                  {"cv", camera.cv},
                  {"k1", k[0]},
                  {"k2", k[1]},
                  {fisheye() ? "k3" : "p1", k[2]},
                  {fisheye() ? "k4" : "p2", k[3]}},
                 std::numeric_limits<double>::infinity());
  const auto numbers = report()["numbers"];
  EXPECT_LT(numbers["fu"]["sigma"], 0.5);
  const auto read = value_of(read_camera_calibration(file("camera.yaml")));
  EXPECT_EQ(read.distortion, GetParam());
  EXPECT_EQ(read.width, 752);
  constexpr double kText_px = 1e-5;  // six decimals
  EXPECT_NEAR(read.fu, numbers["fu"]["value"], kText_px);
  EXPECT_NEAR(read.cv, numbers["cv"]["value"], kText_px);
  EXPECT_NEAR(read.coefficients[1], numbers["k2"]["value"], 1e-8);
  EXPECT_THAT(content_of(file("camera.html")),
              ::testing::AllOf(HasSubstr("Coverage"), HasSubstr("Reprojection")));
}

using CalibrateCameraInput = CalibrateCamera;
INSTANTIATE_TEST_SUITE_P(Input, CalibrateCameraInput,
                         ::testing::Values(Distortion::kRadialTangential));

TEST_P(CalibrateCameraInput, NeedsPictures) {
  std::filesystem::create_directories(pictures_);
  expect_refused("holds neither pictures");
  photograph(3, 0.5, 0.8);
  expect_refused("too few data");
  arguments_.input = folder_.file("nothing.mp4");
  EXPECT_THAT(refused(run_calibrate_camera), HasSubstr("nothing.mp4"));
}

TEST_P(CalibrateCameraInput, NeedsTagsOfTheFamily) {
  photograph(6, 0.5, 0.8);
  arguments_.family = "tag25h9";
  expect_refused("no tag of 20 px");
  arguments_.family = "tag99h99";
  expect_refused("family");
}

TEST_P(CalibrateCameraInput, WritesAUselessResultOnlyByForce) {
  photograph(12, 0.1, 0.05);
  expect_refused("--force");
  EXPECT_FALSE(std::filesystem::exists(file("camera.yaml")));
  EXPECT_EQ(report()["verdict"], "useless");
  arguments_.force = true;
  calibrate();
  EXPECT_THAT(
      content_of(file("camera.yaml")),
      ::testing::AllOf(HasSubstr("verdict: useless"), HasSubstr("intrinsics_sigma: {focal: ")));
  EXPECT_TRUE(read_camera_calibration(file("camera.yaml")));
}

TEST_P(CalibrateCameraInput, CornersNeedTheImageSize) {
  arguments_.corners = folder_.write("corners.csv", "image,tag,corner,u,v\n");
  for (const char* wrong : {"", "640", "640x", "x480", "640x480x3", "0x480"}) {
    arguments_.size = wrong;
    EXPECT_THAT(refused(run_calibrate_camera), HasSubstr("--size")) << wrong;
  }
}

TEST_P(CalibrateCameraInput, RefusesPicturesOfTwoSizes) {
  photograph(2, 0.5, 0.8);
  GrayImage other;
  other.resize(100, 80);
  save("9999.png", other);
  expect_refused("100 x 80");
}

TEST_P(CalibrateCameraInput, CheckerboardHasInnerCorners) {
  photograph(3, 0.5, 0.8);
  for (const char* wrong : {"9", "9x", "x6", "9x6x2", "2x9", "9x-6", "nine"}) {
    SCOPED_TRACE(wrong);
    arguments_.checkerboard = wrong;
    expect_refused("inner corners");
  }
  arguments_.checkerboard = "9x6";
  expect_refused("no whole checkerboard of 9x6");
}

/// Squares averaged over 4 × 4 points of each pixel.
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
  std::vector<double> corners;  // of pixels: where all four are equal, so is what is between
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

TEST_P(CalibrateCamera, FindsTheLensWithACheckerboard) {
  CameraModel camera = truth();  // half the size: the pictures are drawn slowly
  camera.width = 376;
  camera.height = 240;
  camera.fu /= 2;
  camera.fv /= 2;
  camera.cu = camera.cu / 2 - 0.25;
  camera.cv = camera.cv / 2 - 0.25;
  CalibrationScene scene(camera, 5);
  for (int i = 0; i < 40; ++i)
    save(std::to_string(100 + i) + ".png",
         checkerboard_picture(camera, scene.board_pose(0.7, 0.8), 7, 5, 0.03));
  arguments_.checkerboard = "7x5";
  arguments_.lens = lens();
  calibrate();
  EXPECT_GT(report()["images"]["used"], 15);
  expect_numbers({{"fu", camera.fu}, {"fv", camera.fv}, {"cu", camera.cu}, {"cv", camera.cv}}, 1.0);
}

}  // namespace
}  // namespace fiducap
