#pragma once

#include "tools/calibrate/calibrate_camera_command.hpp"
#include "tools/calibrate/calibrate_extrinsics_command.hpp"
#include "tools/calibrate/calibrate_imu_command.hpp"
#include "tools/terminal.hpp"

namespace CLI {
class App;
}

namespace fiducap {

struct CalibrateArguments {
  CalibrateImuArguments imu;
  CalibrateExtrinsicsArguments extrinsics;
  CalibrateCameraArguments camera;
};

/// Adds `fiducap calibrate …`. @param arguments, chosen  outlive `app`
void add_calibrate(CLI::App& app, CalibrateArguments& arguments, ChosenVerb& chosen);

}  // namespace fiducap
