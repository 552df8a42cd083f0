#include "daemon/bodies/body_worker.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

CameraMount told() {
  CameraMount mount;
  mount.position_sigma_m = 0.01;
  mount.rotation_sigma_rad = 0.01;
  mount.time_shift_sigma_s = 0.02;
  return mount;
}

ExtrinsicsEstimate learned(double position_m, double rotation_rad, double shift_sigma_s) {
  ExtrinsicsEstimate camera;
  camera.covariance.diagonal().head<3>().setConstant(position_m * position_m / 3);
  camera.covariance.diagonal().tail<3>().setConstant(rotation_rad * rotation_rad / 3);
  camera.clock.shift_s = 0.03124;
  camera.clock.shift_sigma_s = shift_sigma_s;
  return camera;
}

TEST(CalibrationReport, SaysHowWellEverythingIsKnown) {
  EXPECT_EQ(calibration_text(0, learned(0.002, 0.0004, 0.0001), told()),
            "camera 0: position ±2 mm, rotation ±0.4 mrad, clock +31.24 ±0.1 ms");
}

TEST(CalibrationReport, SaysWhatWasLearnedOfALens) {
  ExtrinsicsEstimate camera = learned(0.002, 0.0004, 0.0001);
  camera.lens = {{0.0812, {0, 0}}, 0.0012, {0.5, 0.5}};
  EXPECT_EQ(calibration_text(0, camera, told()),
            "camera 0: position ±2 mm, rotation ±0.4 mrad, clock +31.24 ±0.1 ms, focal length "
            "+8.12 ±0.12 %");
  camera.lens.offset.k1 = -0.05;
  camera.lens.k1_sigma = 0.003;
  EXPECT_TRUE(calibration_text(0, camera, told()).ends_with(", k1 -0.050 ±0.003"));
  CameraMount guessed = told();
  guessed.k1_sigma = 0.1;
  camera.lens.k1_sigma = 0.09;
  EXPECT_EQ(calibration_text(0, camera, guessed).find("k1"), std::string::npos) << "not shown";
  guessed.focal_sigma = 0.1;
  camera.lens.focal_sigma = 0.09;
  EXPECT_NE(calibration_text(0, camera, guessed).find("lens not shown"), std::string::npos);
}

TEST(CalibrationReport, NamesWhatTheMotionDidNotShow) {
  const std::string text = calibration_text(1, learned(0.017, 0.0004, 0.019), told());
  EXPECT_NE(text.find("position not shown by this motion (turn the body about two axes)"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("clock not shown"), std::string::npos) << text;
}

TEST(CalibrationReport, SaysWhatWasTakenAsExact) {
  CameraMount exact = told();
  exact.position_sigma_m = 0;
  ExtrinsicsEstimate camera = learned(0, 0.0004, 0);
  camera.clock.readout_s = 0.015;
  camera.clock.readout_sigma_s = 0.0005;
  EXPECT_EQ(calibration_text(0, camera, exact),
            "camera 0: position taken as exact, rotation ±0.4 mrad, readout 15.00 ±0.5 ms");
}

}  // namespace
}  // namespace fiducap
