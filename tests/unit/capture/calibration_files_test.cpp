#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/lens/calibration_files.hpp"
#include "support/shared_data.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

// A camera 10 cm ahead of the IMU and looking along its x: camera z = IMU x, camera x = -IMU y,
// camera y = -IMU z.
constexpr const char* kTwoCameras =
    "cam0:\n"
    "  T_cam_imu:\n"
    "  - [0.0, -1.0, 0.0, 0.02]\n"
    "  - [0.0, 0.0, -1.0, 0.03]\n"
    "  - [1.0, 0.0, 0.0, -0.1]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n"
    "  cam_overlaps: [1]\n"
    "  camera_model: pinhole\n"
    "  distortion_coeffs: [-0.05, 0.03, -0.0004, 0.0005]\n"
    "  distortion_model: radtan\n"
    "  intrinsics: [400.5, 401.5, 420.0, 238.0]\n"
    "  resolution: [848, 480]\n"
    "  rostopic: /left\n"
    "  timeshift_cam_imu: 0.0025\n"
    "cam1:\n"
    "  T_cn_cnm1:\n"
    "  - [1.0, 0.0, 0.0, -0.11]\n"
    "  - [0.0, 1.0, 0.0, 0.0]\n"
    "  - [0.0, 0.0, 1.0, 0.0]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n"
    "  camera_model: pinhole\n"
    "  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]\n"
    "  distortion_model: equidistant\n"
    "  intrinsics: [300.0, 301.0, 424.0, 240.0]\n"
    "  resolution: [848, 480]\n";

class CalibrationFileTest : public testing::Test {
 protected:
  std::string error_of_camchain(const std::string& content) {
    const auto read = read_kalibr_camchain(folder_.write("camchain.yaml", content));
    return read ? "none" : read.error().text();
  }
  std::string error_of_camera(const std::string& content) {
    const auto read = read_camera_calibration(folder_.write("camera.yaml", content));
    return read ? "none" : read.error().text();
  }
  CameraModel camera(const std::string& content) {
    const auto read = read_camera_calibration(folder_.write("camera.yaml", content));
    EXPECT_TRUE(read) << read.error().text();
    return read.value_or(CameraModel{});
  }
  static std::string replaced(std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    return text;
  }
  TemporaryFolder folder_;
};

TEST_F(CalibrationFileTest, KalibrsTcamImuIsTurnedAround) {
  const auto mounts = read_kalibr_camchain(folder_.write("c.yaml", kTwoCameras));
  ASSERT_TRUE(mounts) << mounts.error().text();
  ASSERT_EQ(mounts->size(), 2u);
  const CameraMount& left = mounts->at(0);
  EXPECT_NEAR((left.X_BV.p - Eigen::Vector3d(0.1, 0.02, 0.03)).norm(), 0, 1e-12);
  EXPECT_NEAR((left.X_BV.q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 0, 1e-12);
  EXPECT_NEAR((left.X_BV.q * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitY()).norm(), 0, 1e-12);
  EXPECT_EQ(left.time_shift, std::chrono::microseconds(2500));
  EXPECT_EQ(left.model.width, 848);
  EXPECT_EQ(left.model.fu, 400.5);
  EXPECT_EQ(left.model.cv, 238);
  EXPECT_EQ(left.model.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(left.model.coefficients, (std::array<double, 5>{-0.05, 0.03, -0.0004, 0.0005, 0}));
}

TEST_F(CalibrationFileTest, ALaterCameraMayBeGivenByTheOneBeforeIt) {
  const auto mounts = read_kalibr_camchain(folder_.write("c.yaml", kTwoCameras));
  ASSERT_TRUE(mounts) << mounts.error().text();
  // 0.11 m along the left camera's x, which is -y of the IMU
  EXPECT_NEAR((mounts->at(1).X_BV.p - Eigen::Vector3d(0.1, -0.09, 0.03)).norm(), 0, 1e-12);
  EXPECT_EQ(mounts->at(1).model.distortion, Distortion::kEquidistant);
}

TEST_F(CalibrationFileTest, OpenVinssTimuCamIsTakenAsItStands) {
  const auto one = read_kalibr_camchain(folder_.write(
      "c.yaml", "%YAML:1.0\n---\n" + replaced(kTwoCameras, "T_cam_imu", "T_imu_cam")));
  ASSERT_TRUE(one) << one.error().text();
  EXPECT_NEAR((one->at(0).X_BV.p - Eigen::Vector3d(0.02, 0.03, -0.1)).norm(), 0, 1e-12);
}

TEST_F(CalibrationFileTest, AFaultyCamchainIsRefusedWithTheReason) {
  for (const char* model : {"omni", "ds", "eucm"}) {
    const std::string content =
        replaced(kTwoCameras, "camera_model: pinhole", std::string("camera_model: ") + model);
    EXPECT_THAT(error_of_camchain(content),
                HasSubstr(std::string("cam0.camera_model is ") + model));
  }
  EXPECT_THAT(error_of_camchain(replaced(kTwoCameras, "radtan", "fov")),
              HasSubstr("fov is not supported"));
  EXPECT_THAT(error_of_camchain(replaced(kTwoCameras, "T_cam_imu", "T_other")),
              HasSubstr("T_cam_imu is missing"));
  EXPECT_THAT(
      error_of_camchain(replaced(kTwoCameras, "[0.0, -1.0, 0.0, 0.02]", "[0.0, -1.0, 0.0]")),
      HasSubstr("has 15"));
  EXPECT_THAT(
      error_of_camchain(replaced(kTwoCameras, "[1.0, 0.0, 0.0, -0.1]", "[0.5, 0.0, 0.0, -0.1]")),
      HasSubstr("no rotation"));
  EXPECT_THAT(error_of_camchain(replaced(kTwoCameras, "400.5", "-400.5")),
              HasSubstr("must be finite and > 0"));
  EXPECT_THAT(error_of_camchain("imu0: {}\n"), HasSubstr("no key cam0"));
  EXPECT_THAT(error_of_camchain("cam0: 3\n"), HasSubstr("cam0 must be a section"));
  EXPECT_THAT(read_kalibr_camchain("/nowhere.yaml").error().text(), HasSubstr("no such file"));
}

TEST_F(CalibrationFileTest, KalibrsImuIsReadFlatAndBelowImu0) {
  const std::string flat =
      "accelerometer_noise_density: 0.002\naccelerometer_random_walk: 0.0004\n"
      "gyroscope_noise_density: 0.0002\ngyroscope_random_walk: 1.0e-05\nrostopic: "
      "'/imu'\nupdate_rate: 400\n";
  const std::string nested =
      "imu0:\n  accelerometer_noise_density: 0.002\n  accelerometer_random_walk: 0.0004\n"
      "  gyroscope_noise_density: 0.0002\n  gyroscope_random_walk: 1.0e-05\n  update_rate: 400\n";
  for (const std::string& content : {flat, nested}) {
    const auto noise = read_kalibr_imu(folder_.write("imu.yaml", content));
    ASSERT_TRUE(noise) << noise.error().text();
    EXPECT_EQ(noise->accel_noise_m_s2_rtHz, 0.002);
    EXPECT_EQ(noise->accel_walk_m_s3_rtHz, 0.0004);
    EXPECT_EQ(noise->gyro_noise_rad_s_rtHz, 0.0002);
    EXPECT_EQ(noise->gyro_walk_rad_s2_rtHz, 1e-5);
    EXPECT_EQ(noise->rate_hz, 400);
  }
  const auto broken = read_kalibr_imu(folder_.write("imu.yaml", "update_rate: -1\n"));
  ASSERT_FALSE(broken);
  EXPECT_THAT(broken.error().text(), HasSubstr("accelerometer_noise_density is missing"));
  EXPECT_THAT(broken.error().text(), HasSubstr("update_rate must be > 0"));
}

TEST_F(CalibrationFileTest, KalibrsOwnFilesAreRead) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  const auto mounts =
      read_kalibr_camchain((*data / "motion/ar_table/d455_camchain_imucam.yaml").string());
  ASSERT_TRUE(mounts) << mounts.error().text();
  EXPECT_NEAR(mounts->at(0).X_BV.p.norm(), 0.0364, 1e-4);
  EXPECT_EQ(mounts->at(0).time_shift, Duration(2524378));
  const auto noise = read_kalibr_imu((*data / "motion/ar_table/d455_imu.yaml").string());
  ASSERT_TRUE(noise) << noise.error().text();
  EXPECT_EQ(noise->rate_hz, 400);
}

TEST_F(CalibrationFileTest, ARosCameraInfoIsRead) {
  const CameraModel model = camera(
      "image_width: 640\nimage_height: 480\ncamera_name: narrow\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [500, 0, 320.5, 0, 501, 240.5, 0, 0, 1]\n"
      "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, "
      "-0.2, 0.001, 0.002, 0.3]\n");
  EXPECT_EQ(model.width, 640);
  EXPECT_EQ(model.height, 480);
  EXPECT_EQ(model.fv, 501);
  EXPECT_EQ(model.cu, 320.5);
  EXPECT_EQ(model.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(model.coefficients, (std::array<double, 5>{0.1, -0.2, 0.001, 0.002, 0.3}));
}

constexpr const char* kOpenCv =
    "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 5.0e+02, 0., 320., 0., 5.01e+02, 240., 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ 0.1, "
    "0.2, 0.3, 0.4 ]\n";

TEST_F(CalibrationFileTest, FourCoefficientsOfOpenCvAreOnlyReadWithTheirModel) {
  EXPECT_THAT(error_of_camera(kOpenCv), HasSubstr("add distortion_model"));
  EXPECT_EQ(camera(kOpenCv + std::string("fisheye_model: 1\n")).distortion,
            Distortion::kEquidistant);
  EXPECT_EQ(camera(kOpenCv + std::string("distortion_model: plumb_bob\n")).distortion,
            Distortion::kRadialTangential);
}

TEST_F(CalibrationFileTest, EurocsSensorYamlIsRead) {
  const CameraModel model = camera(
      "sensor_type: camera\nresolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [458, 457, "
      "367, 248]\n"
      "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, "
      "1.8e-05]\n");
  EXPECT_EQ(model.width, 752);
  EXPECT_EQ(model.cv, 248);
  EXPECT_EQ(model.coefficients[3], 1.8e-5);
}

TEST_F(CalibrationFileTest, JsonIsReadInBothShapes) {
  const CameraModel plain = camera(
      "{\n\t\"width\": 1920, \"height\": 1080,\n\t\"K\": [[1826.5, 0.0, 983.25], [0.0, 1821.5, "
      "538.75], [0, 0, 1]],\n"
      "\t\"dist_k1k2p1p2k3\": [0.16, -0.82, 0.0, 0.0, 0.0], \"source\": \"a board\"}");
  EXPECT_EQ(plain.width, 1920);
  EXPECT_EQ(plain.fu, 1826.5);
  EXPECT_EQ(plain.cv, 538.75);
  EXPECT_EQ(plain.coefficients[1], -0.82);
  const CameraModel wpilib = camera(
      "{\"camera_matrix\": [1826.5, 0, 983.25, 0, 1821.5, 538.75, 0, 0, 1], "
      "\"avg_reprojection_error\": 0.4,"
      "\"distortion_coefficients\": [0.16, -0.82, 0, 0, 0.1, 0, 0, 0], \"resolution\": {\"width\": "
      "1920, \"height\": 1080}}");
  EXPECT_EQ(wpilib.height, 1080);
  EXPECT_EQ(wpilib.coefficients[4], 0.1);
}

TEST_F(CalibrationFileTest, ALensThatIsNotModelledIsRefused) {
  EXPECT_THAT(
      error_of_camera("{\"camera_matrix\": [1, 0, 9, 0, 1, 9, 0, 0, 1], \"resolution\": [20, 20],"
                      "\"distortion_coefficients\": [0.1, 0.1, 0, 0, 0.1, 0.2, 0.3, 0.4]}"),
      HasSubstr("the file has 8"));
  EXPECT_THAT(
      error_of_camera("{\"camera_matrix\": [1, 0.5, 9, 0, 1, 9, 0, 0, 1], \"resolution\": [20, 20],"
                      "\"distortion_coefficients\": [0, 0, 0, 0, 0]}"),
      HasSubstr("skew"));
}

TEST_F(CalibrationFileTest, AFileOfAnotherKindIsNamedAsSuch) {
  EXPECT_THAT(error_of_camera("a: 1\n"), HasSubstr("is no camera calibration"));
  EXPECT_THAT(error_of_camera(kTwoCameras), HasSubstr("Kalibr camchain"));
  EXPECT_THAT(error_of_camera("{\"camera_matrix\": [1, 0, 9, 0, 1, 9, 0, 0, 1]}"),
              HasSubstr("image_width is missing"));
  EXPECT_THAT(error_of_camera(std::string("\x89PNG\r\n\x1a\n\0\0\0", 11)), HasSubstr("YAML"));
  EXPECT_THAT(error_of_camera(""), HasSubstr("is not a YAML map"));
}

TEST_F(CalibrationFileTest, TheCalibrationOfTheFieldVideoIsRead) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  const auto model =
      read_camera_calibration((*data / "detector/wpical/calibration_derived.json").string());
  ASSERT_TRUE(model) << model.error().text();
  EXPECT_EQ(model->width, 1920);
  EXPECT_EQ(model->fu, 1826.12);
  EXPECT_EQ(model->coefficients[1], -0.819752);
}

}  // namespace
}  // namespace fiducap
