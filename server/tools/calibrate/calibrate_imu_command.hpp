#pragma once

#include <string>

#include "calibration/imu/static_imu.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct CalibrateImuArguments {
  std::string recording;
  std::string out{"calibration"};
  bool json{false};
};

/// `fiducap calibrate imu`: writes imu.yaml and allan.svg. @return exit code
[[nodiscard]] int run_calibrate_imu(const CalibrateImuArguments& arguments,
                                    const Terminal& terminal);

/// Kalibr's imu.yaml, as read_kalibr_imu reads it; comments say what is a bound only.
[[nodiscard]] std::string to_kalibr_imu(const StaticImuNoise& result, const std::string& heading);

}  // namespace fiducap
