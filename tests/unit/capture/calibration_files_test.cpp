#include <gmock/gmock.h>

#include "capture/lens/calibration_files.hpp"
#include "support/lens_models.hpp"
#include "support/replaced.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::_;
using testing::HasSubstr;

// A camera 10 cm ahead of the IMU and looking along its x: camera z = IMU x, camera x = -IMU y,
// camera y = -IMU z.
constexpr const char* kTwoCameras = R"(cam0:
  T_cam_imu:
  - [0.0, -1.0, 0.0, 0.02]
  - [0.0, 0.0, -1.0, 0.03]
  - [1.0, 0.0, 0.0, -0.1]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.05, 0.03, -0.0004, 0.0005]
  distortion_model: radtan
  intrinsics: [400.5, 401.5, 420.0, 238.0]
  resolution: [848, 480]
  rostopic: /left
  timeshift_cam_imu: 0.0025
cam1:
  T_cn_cnm1: [[1, 0, 0, -0.11], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  camera_model: pinhole
  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]
  distortion_model: equidistant
  intrinsics: [300.0, 301.0, 424.0, 240.0]
  resolution: [848, 480]
)";

class CalibrationFileTest : public testing::Test {
 protected:
  /// @param width, height  of the images; 0: not known
  Expected<std::vector<CalibratedCamera>> cameras(const std::string& content, int width = 0,
                                                  int height = 0) {
    CameraMount images;
    images.model = {width, height};
    return read_calibration(folder_.write("calibration", content), images);
  }
  Expected<CameraModel> camera(const std::string& content) {
    return read_camera_calibration(folder_.write("camera.yaml", content));
  }
  TemporaryFolder folder_;
};

TEST_F(CalibrationFileTest, ReadsKalibrCamerasRelativeToImuAndCamera) {
  const auto mounts = value_of(cameras(kTwoCameras));
  ASSERT_EQ(mounts.size(), 2u);
  const CameraMount& left = mounts[0].mount;
  EXPECT_NEAR((left.X_BV.p - Eigen::Vector3d(0.1, 0.02, 0.03)).norm(), 0, 1e-12);
  EXPECT_NEAR((left.X_BV.q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 0, 1e-12);
  EXPECT_NEAR((left.X_BV.q * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitY()).norm(), 0, 1e-12);
  EXPECT_EQ(left.time_shift, std::chrono::microseconds(2500));
  EXPECT_EQ(parts_of(left.model), parts_of(radial_tangential({848, 480, 400.5, 401.5, 420, 238},
                                                             {-0.05, 0.03, -0.0004, 0.0005})));
  // 0.11 m along the left camera's x, which is -y of the IMU
  EXPECT_NEAR((mounts[1].mount.X_BV.p - Eigen::Vector3d(0.1, -0.09, 0.03)).norm(), 0, 1e-12);
  EXPECT_EQ(mounts[1].mount.model.distortion, Distortion::kEquidistant);
}

TEST_F(CalibrationFileTest, ReadsTheInversePoseOfOpenVins) {
  const auto one =
      value_of(cameras("%YAML:1.0\n---\n" + replaced(kTwoCameras, "T_cam_imu", "T_imu_cam")));
  EXPECT_NEAR((one[0].mount.X_BV.p - Eigen::Vector3d(0.02, 0.03, -0.1)).norm(), 0, 1e-12);
}

TEST_F(CalibrationFileTest, TakesTheLensOfCamerasWithoutAPlace) {
  const std::string no_imu = replaced(kTwoCameras, "T_cam_imu", "T_other");
  CameraMount otherwise;
  otherwise.X_BV.p = {1, 2, 3};
  const auto read = value_of(read_calibration(folder_.write("camchain.yaml", no_imu), otherwise));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].place, CameraPlace::kUnknown);
  EXPECT_EQ(read[0].mount.X_BV.p, otherwise.X_BV.p) << "as configured";
  EXPECT_EQ(read[0].mount.model.fu, 400.5);
  EXPECT_EQ(read[1].place, CameraPlace::kBesideTheFirst);
  EXPECT_NEAR((read[1].mount.X_BV.p - Eigen::Vector3d(1.11, 2, 3)).norm(), 0, 1e-12);
  // TagSLAM's cameras.yaml
  const auto tagslam = value_of(
      cameras("cam0:\n  camera_model: pinhole\n  distortion_model: plumb_bob\n"
              "  distortion_coeffs: [0.1, 0.2, 0, 0, 0]\n  intrinsics: [500, 500, 320, 240]\n"
              "  resolution: [640, 480]\n  tagtopic: /tags\n  frame_id: cam0\n"));
  EXPECT_EQ(tagslam[0].mount.model.coefficients[1], 0.2);
}

TEST_F(CalibrationFileTest, ReadsTheFilesOfPhotonVision) {
  for (const char* key : {"cameraExtrinsics", "distCoeffs"}) {  // old and new
    const CameraModel lens =
        value_of(camera(
            R"({"resolution": {"width": 640.0, "height": 480.0},
      "cameraIntrinsics": {"rows": 3, "cols": 3, "type": 6,
                           "data": [505.7, 0.0, 322.7, 0.0, 504.3, 254.2, 0.0, 0.0, 1.0]},
      ")" + std::string(key) +
            R"(": {"rows": 1, "cols": 5, "type": 6, "data": [0.1373, -0.2904, 8e-4, -4e-4, 0.09]},
      "perViewErrors": [0.47]})"));
    EXPECT_EQ(parts_of(lens), parts_of(radial_tangential({640, 480, 505.7, 504.3, 322.7, 254.2},
                                                         {0.1373, -0.2904, 8e-4, -4e-4, 0.09})));
  }
}

TEST_F(CalibrationFileTest, TakesTheLensOfPhotonVisionForTheModeOfTheCamera) {
  const auto lens = [](const std::string& size, const std::string& focal) {
    return "{\"resolution\": {" + size + "}, \"cameraIntrinsics\": {\"rows\": 3, \"cols\": 3, " +
           "\"data\": [" + focal +
           ", 0, 320, 0, 500, 240, 0, 0, 1]}, \"distCoeffs\": [0, 0, 0, 0, 0]}";
  };
  const std::string settings = "{\"calibrations\": [" +
                               lens("\"width\": 1280, \"height\": 720", "900") + ", " +
                               lens("\"width\": 640, \"height\": 480", "505") + "]}";
  EXPECT_EQ(value_of(cameras(settings, 640, 480)).at(0).mount.model.fu, 505);
  EXPECT_EQ(value_of(cameras(settings, 1280, 720)).at(0).mount.model.fu, 900);
  EXPECT_THAT(error_of(cameras(settings, 320, 240)),
              HasSubstr("1280 x 720, 640 x 480), 0 of them"));
  EXPECT_THAT(error_of(cameras("{\"calibrations\": []}")), HasSubstr("has no lens"));
}

TEST_F(CalibrationFileTest, ReadsTheCameraOfDso) {
  EXPECT_EQ(parts_of(value_of(camera("RadTan 505 504 322 254 0.1 -0.2 1e-3 2e-3\n640 480\n"
                                     "crop\n640 480\n"))),
            parts_of(radial_tangential({640, 480, 505, 504, 322, 254}, {0.1, -0.2, 1e-3, 2e-3})));
  EXPECT_EQ(parts_of(value_of(camera("EquiDistant 0.5 0.75 0.5 0.5 1 2 3 4\n640 480\nnone\n"))),
            parts_of(equidistant({640, 480, 320, 360, 319.5, 239.5}, {1, 2, 3, 4})));
  EXPECT_THAT(error_of(camera("FOV 500 500 320 240 0.9\n640 480\n")), HasSubstr("fov"));
  EXPECT_THAT(error_of(camera("some text\n")), HasSubstr("is no camera calibration"));
}

TEST_F(CalibrationFileTest, ReadsTheSizeOfCalibdb) {
  EXPECT_EQ(value_of(camera(R"({"img_size": {"rows": 2, "cols": 1, "dt": "d", "data": [640, 480]},
      "camera_matrix": [500, 0, 320, 0, 500, 240, 0, 0, 1],
      "distortion_coefficients": [0, 0, 0, 0, 0]})"))
                .height,
            480);
}

TEST_F(CalibrationFileTest, ReadsIniOfRosAndXmlOfOpenCv) {
  const CameraModel wanted =
      radial_tangential({640, 480, 500, 501, 319.5, 239.5}, {0.01, -0.002, 1e-4, -2e-4, 0.5});
  const std::string ini =
      "# oST version 5.0 parameters\n\n[image]\n\nwidth\n640\n\nheight\n480\n\n"
      "[narrow_stereo/left]\n\ncamera matrix\n500.0 0.0 319.5\n0.0 501.0 239.5\n0.0 0.0 1.0\n\n"
      "distortion\n0.01 -0.002 0.0001 -0.0002 0.5\n\nrectification\n1 0 0\n0 1 0\n0 0 1\n\n"
      "projection\n501 0 319.5 0\n0 501 239.5 0\n0 0 1 0\n";
  const std::string xml =
      "<?xml version=\"1.0\"?>\n<opencv_storage>\n"
      "<calibration_time>\"Mon 23 Nov 2026\"</calibration_time>\n<!-- a <comment> -->\n"
      "<image_width>640</image_width>\n<image_height>480</image_height>\n<empty/>\n"
      "<camera_matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n"
      "  <dt>d</dt>\n  <data>\n    5.0e+02 0. 319.5 0.\n    501. 239.5 0. 0. 1.</data>"
      "</camera_matrix>\n"
      "<distortion_coefficients type_id=\"opencv-matrix\">\n  <rows>5</rows>\n  <cols>1</cols>\n"
      "  <dt>d</dt>\n  <data>1.e-02 -0.002 0.0001 -0.0002 0.5</data></distortion_coefficients>\n"
      "</opencv_storage>\n";
  std::string dos;
  for (const char c : ini) dos += c == '\n' ? std::string("\r\n") : std::string(1, c);
  const std::string old =
      replaced(replaced(xml, "<image_width>640</image_width>", "<image_Width>640</image_Width>"),
               "<image_height>480</image_height>", "<image_Height>480</image_Height>");
  for (const std::string& text : {ini, dos, xml, old})
    EXPECT_EQ(parts_of(camera(text).value_or(CameraModel{})), parts_of(wanted)) << text;
  EXPECT_THAT(error_of(camera("<?xml version=\"1.0\"?><opencv_storage><a></b>")),
              HasSubstr("is no camera calibration"));
  EXPECT_THAT(error_of(camera("[image]\nwidth\n640\n")), HasSubstr("is no camera calibration"));
}

TEST_F(CalibrationFileTest, ReadsTheCamerasOfColmapWithItsOriginOfPixels) {
  const std::string list =
      "# Camera list\n# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
      "1 SIMPLE_RADIAL 640 480 500 320 240 0.1\n3 OPENCV_FISHEYE 848 480 300 301 320 240 1 2 3 4\n"
      "4 FULL_OPENCV 640 360 300 301 320 240 1 2 3 4 5 6 7 8\n";
  const auto of_size = [&](int width, int height) {
    return parts_of(value_of(cameras(list, width, height)).at(0).mount.model);
  };
  EXPECT_EQ(of_size(640, 480),
            parts_of(radial_tangential({640, 480, 500, 500, 319.5, 239.5}, {0.1})));
  EXPECT_EQ(of_size(848, 480),
            parts_of(equidistant({848, 480, 300, 301, 319.5, 239.5}, {1, 2, 3, 4})));
  EXPECT_EQ(of_size(640, 360),
            parts_of(rational({640, 360, 300, 301, 319.5, 239.5}, {1, 2, 3, 4, 5, 6, 7, 8})));
  EXPECT_THAT(error_of(cameras(list)), HasSubstr("has 3 lenses (for images of 640 x 480, 848"));
  EXPECT_THAT(error_of(cameras(list + "5 PINHOLE 848 480 9 9 9 9\n", 848, 480)),
              HasSubstr("2 of them for this camera's images of 848 x 480: keep only"));
  EXPECT_THAT(error_of(cameras("1 FOV 640 480 500 500 320 240 0.9\n")), HasSubstr("is FOV"));
}

TEST_F(CalibrationFileTest, ReadsTheCalibrationOfBasalt) {
  constexpr const char* kBasalt = R"({"value0": {
    "T_imu_cam": [{"px": 0.1, "py": 0.2, "pz": 0.3, "qx": 0, "qy": 0, "qz": 1, "qw": 0}],
    "intrinsics": [{"camera_type": "kb4", "intrinsics": {"fx": 300, "fy": 301, "cx": 320, "cy": 240,
                    "k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4}}],
    "resolution": [[640, 480]], "cam_time_offset_ns": 5000000}})";
  const auto read = value_of(cameras(kBasalt));
  EXPECT_EQ(parts_of(read[0].mount.model),
            parts_of(equidistant({640, 480, 300, 301, 320, 240}, {0.1, 0.2, 0.3, 0.4})));
  EXPECT_EQ(read[0].mount.X_BV.p, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(read[0].place, CameraPlace::kOnBody);
  EXPECT_EQ(read[0].mount.time_shift, std::chrono::milliseconds(5));
  EXPECT_THAT(error_of(cameras(replaced(kBasalt, "kb4", "ds"))), HasSubstr("pinhole-radtan8"));
  EXPECT_THAT(error_of(cameras("{\"value0\": {}}")), HasSubstr("is no camera calibration"));
}

TEST_F(CalibrationFileTest, ReadsTheLensesOfVinsOrbSlamAndMrcal) {
  const auto radtan =
      radial_tangential({752, 480, 461.6, 460.3, 363, 248.1}, {-0.29, 0.08, 0.0001, 0.0002});
  const auto fisheye = equidistant({752, 480, 461.6, 460.3, 363, 248.1}, {0.1, 0.2, 0.3, 0.4});
  const std::string vins =
      "%YAML:1.0\nmodel_type: PINHOLE\ncamera_name: camera\nimage_width: 752\nimage_height: 480\n"
      "distortion_parameters:\n   k1: -0.29\n   k2: 0.08\n   p1: 0.0001\n   p2: 0.0002\n"
      "projection_parameters:\n   fx: 461.6\n   fy: 460.3\n   cx: 363\n   cy: 248.1\n";
  EXPECT_EQ(parts_of(value_of(camera(vins))), parts_of(radtan));
  EXPECT_EQ(parts_of(value_of(camera(
                "%YAML:1.0\n---\nmodel_type: KANNALA_BRANDT\nimage_width: 752\nimage_height: 480\n"
                "projection_parameters:\n   k2: 0.1\n   k3: 0.2\n   k4: 0.3\n   k5: 0.4\n"
                "   mu: 461.6\n   mv: 460.3\n   u0: 363\n   v0: 248.1\n"))),
            parts_of(fisheye));
  EXPECT_THAT(error_of(camera("model_type: MEI\nimage_width: 752\nimage_height: 480\n"
                              "mirror_parameters: {xi: 1.5}\n")),
              HasSubstr("model_type is MEI; supported are PINHOLE and KANNALA_BRANDT"));
  EXPECT_EQ(parts_of(value_of(camera(
                "%YAML:1.0\n\n#----\nCamera.fx: 461.6\nCamera.fy: 460.3\nCamera.cx: 363.0\n"
                "Camera.cy: 248.1\nCamera.k1: -0.29\nCamera.k2: 0.08\nCamera.p1: 0.0001\n"
                "Camera.p2: 0.0002\nCamera.width: 752\nCamera.height: 480\nCamera.fps: 20.0\n"))),
            parts_of(radtan));
  EXPECT_EQ(parts_of(value_of(camera(
                "%YAML:1.0\nCamera.type: \"KannalaBrandt8\"\nCamera1.fx: 461.6\nCamera1.fy: 460.3\n"
                "Camera1.cx: 363.0\nCamera1.cy: 248.1\nCamera1.k1: 0.1\nCamera1.k2: 0.2\n"
                "Camera1.k3: 0.3\nCamera1.k4: 0.4\nCamera.width: 752\nCamera.height: 480\n"))),
            parts_of(fisheye));
  EXPECT_EQ(parts_of(value_of(camera(
                "# generated\n{\n    'lensmodel':  'LENSMODEL_OPENCV4',\n"
                "    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....\n"
                "    'intrinsics': [ 461.6, 460.3, 363, 248.1, -0.29, 0.08, 0.0001, 0.0002,],\n"
                "    'extrinsics': [ 0, 0, 0, 0, 0, 0,],\n    'imagersize': [ 752, 480 ]\n}\n"))),
            parts_of(radtan));
}

TEST_F(CalibrationFileTest, RefusesAFaultyCamchainWithTheReason) {
  const struct {
    const char *from, *to, *reason;
  } kCases[] = {{"camera_model: pinhole", "camera_model: omni", "cam0.camera_model is omni"},
                {"camera_model: pinhole", "camera_model: ds", "cam0.camera_model is ds"},
                {"camera_model: pinhole", "camera_model: eucm", "cam0.camera_model is eucm"},
                {"radtan", "fov", "lens model fov is not supported"},
                {"[0.0, -1.0, 0.0, 0.02]", "[0.0, -1.0, 0.0]", "has 15"},
                {"[1.0, 0.0, 0.0, -0.1]", "[0.5, 0.0, 0.0, -0.1]", "no rotation"},
                {"400.5", "-400.5", "must be finite and > 0"}};
  for (const auto& [from, to, reason] : kCases)
    EXPECT_THAT(error_of(cameras(replaced(kTwoCameras, from, to))), HasSubstr(reason)) << to;
  EXPECT_THAT(error_of(cameras("imu0: {}\n")), HasSubstr("is no camera calibration"));
  EXPECT_THAT(error_of(cameras("cam0: 3\n")), HasSubstr("cam0 must be a section"));
  EXPECT_THAT(error_of(read_calibration("/nowhere.yaml", {})), HasSubstr("no such file"));
}

TEST_F(CalibrationFileTest, ReadsKalibrImuFlatAndBelowImu0) {
  const std::string flat =
      "accelerometer_noise_density: 0.002\naccelerometer_random_walk: 0.0004\n"
      "gyroscope_noise_density: 0.0002\ngyroscope_random_walk: 1.0e-05\nrostopic: "
      "'/imu'\nupdate_rate: 400\n";
  const std::string nested =
      "imu0:\n  accelerometer_noise_density: 0.002\n  accelerometer_random_walk: 0.0004\n"
      "  gyroscope_noise_density: 0.0002\n  gyroscope_random_walk: 1.0e-05\n  update_rate: 400\n";
  for (const std::string& content : {flat, nested}) {
    const auto noise = value_of(read_imu_noise(folder_.write("imu.yaml", content)));
    EXPECT_THAT(noise, testing::FieldsAre(0.0002, 1e-5, 0.002, 0.0004, 400, _, _, _));
  }
  EXPECT_THAT(error_of(read_imu_noise(folder_.write("imu.yaml", "update_rate: -1\n"))),
              testing::AllOf(HasSubstr("accelerometer_noise_density is missing"),
                             HasSubstr("update_rate must be > 0")));
}

TEST_F(CalibrationFileTest, ReadsTheNoiseOfImuUtilsAndVins) {
  const ImuNoise utils = value_of(read_imu_noise(folder_.write(
      "result.yaml",
      "%YAML:1.0\n---\ntype: IMU\nname: mti\nGyr:\n   unit: \" rad/s\"\n   avg-axis:\n"
      "      gyr_n: 2.0e-03\n      gyr_w: 3.0e-05\n   x-axis:\n      gyr_n: 1\n      gyr_w: 1\n"
      "Acc:\n   unit: \" m/s^2\"\n   avg-axis:\n      acc_n: 2.0e-02\n      acc_w: 4.0e-04\n")));
  const ImuNoise vins = value_of(read_imu_noise(folder_.write(
      "vins.yaml", "%YAML:1.0\nacc_n: 0.02\ngyr_n: 0.002\nacc_w: 0.0004\ngyr_w: 3.0e-5\n")));
  for (const ImuNoise& noise : {utils, vins}) {
    EXPECT_EQ(noise.gyro_noise_rad_s_rtHz, 2e-3);
    EXPECT_EQ(noise.gyro_walk_rad_s2_rtHz, 3e-5);
    EXPECT_EQ(noise.accel_noise_m_s2_rtHz, 2e-2);
    EXPECT_EQ(noise.accel_walk_m_s3_rtHz, 4e-4);
  }
}

TEST_F(CalibrationFileTest, ReadsCameraInfoOfRos) {
  const CameraModel read = value_of(camera(R"(image_width: 640
image_height: 480
camera_name: narrow
camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320.5, 0, 501, 240.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -0.2, 0.001, 0.002, 0.3]}
)"));
  EXPECT_EQ(parts_of(read), parts_of(radial_tangential({640, 480, 500, 501, 320.5, 240.5},
                                                       {0.1, -0.2, 0.001, 0.002, 0.3})));
}

constexpr const char* kOpenCv =
    "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 5.0e+02, 0., 320., 0., 5.01e+02, 240., 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ 0.1, "
    "0.2, 0.3, 0.4 ]\n";

TEST_F(CalibrationFileTest, ReadsFourCoefficientsOfOpenCvOnlyWithTheirModel) {
  EXPECT_THAT(error_of(camera(kOpenCv)), HasSubstr("add distortion_model"));
  EXPECT_EQ(value_of(camera(kOpenCv + std::string("fisheye_model: 1\n"))).distortion,
            Distortion::kEquidistant);
  EXPECT_EQ(value_of(camera(kOpenCv + std::string("distortion_model: plumb_bob\n"))).distortion,
            Distortion::kRadialTangential);
}

TEST_F(CalibrationFileTest, ReadsSensorYamlOfEuroc) {
  const CameraModel model = value_of(camera(R"(sensor_type: camera
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458, 457, 367, 248]
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]
)"));
  EXPECT_EQ(model.width, 752);
  EXPECT_EQ(model.cv, 248);
  EXPECT_EQ(model.coefficients[3], 1.8e-5);
}

TEST_F(CalibrationFileTest, ReadsJsonInBothShapes) {
  const CameraModel plain = value_of(camera(
      "{\n\t\"width\": 1920, \"height\": 1080,\n\t\"K\": [[1826.5, 0.0, 983.25], [0.0, 1821.5, "
      "538.75], [0, 0, 1]],\n"
      "\t\"dist_k1k2p1p2k3\": [0.16, -0.82, 0.0, 0.0, 0.0], \"source\": \"a board\"}"));
  EXPECT_EQ(parts_of(plain),
            parts_of(radial_tangential({1920, 1080, 1826.5, 1821.5, 983.25, 538.75},
                                       {0.16, -0.82, 0, 0, 0})));
  const CameraModel wpilib = value_of(camera(R"({"avg_reprojection_error": 0.4,
      "camera_matrix": [1826.5, 0, 983.25, 0, 1821.5, 538.75, 0, 0, 1],
      "distortion_coefficients": [0.16, -0.82, 0, 0, 0.1, 0, 0, 0],
      "resolution": {"width": 1920, "height": 1080}})"));
  EXPECT_EQ(wpilib.height, 1080);
  EXPECT_EQ(wpilib.coefficients[4], 0.1);
}

TEST_F(CalibrationFileTest, ReadsEightCoefficientsAsARationalLens) {
  for (const char* name : {"", "distortion_model: rational_polynomial\n",
                           "distortion_model: plumb_bob\n", "distortion_model: OPENCV8\n"}) {
    const CameraModel lens = value_of(camera(
        std::string("image_width: 640\nimage_height: 480\n"
                    "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n"
                    "distortion_coefficients: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]\n") +
        name));
    EXPECT_EQ(parts_of(lens), parts_of(rational({640, 480, 500, 500, 320, 240},
                                                {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8})))
        << name;
  }
}

TEST_F(CalibrationFileTest, RefusesOtherFilesAndLensesWithTheReason) {
  const std::pair<std::string, const char*> kCases[] = {
      {R"({"camera_matrix": [1, 0, 9, 0, 1, 9, 0, 0, 1], "resolution": [20, 20],
           "distortion_coefficients": [0.1, 0.1, 0, 0, 0.1, 0.2, 0.3, 0.4, 0, 0, 0, 0, 0.1, 0]})",
       "thin prism, tilt"},
      {R"({"camera_matrix": [1, 0.5, 9, 0, 1, 9, 0, 0, 1], "resolution": [20, 20],
           "distortion_coefficients": [0, 0, 0, 0, 0]})",
       "skew"},
      {"a: 1\n", "is no camera calibration"},
      {kTwoCameras, "has 2 cameras"},
      {R"({"camera_matrix": [1, 0, 9, 0, 1, 9, 0, 0, 1]})", "image_width is missing"},
      {std::string("\x89PNG\r\n\x1a\n\0\0\0", 11), "is no camera calibration"},
      {"", "is no camera calibration"}};
  for (const auto& [content, reason] : kCases)
    EXPECT_THAT(error_of(camera(content)), HasSubstr(reason));
}

}  // namespace
}  // namespace fiducap
