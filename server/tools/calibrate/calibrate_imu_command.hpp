#pragma once

#include <string>

#include "base/gravity.hpp"
#include "calibration/imu/static_imu.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct CalibrateImuArguments {
  std::string recording;
  std::string out{"calibration"};
  bool json{false};
  bool poses{false};  ///< Many attitudes at rest instead of one: bias, scale, misalignment.
  double gravity_m_s2{kUsualGravity_m_s2};
};

/// `fiducap calibrate imu`: writes imu.yaml and allan.svg, with `poses` imu_correction.yaml.
/// @return exit code
[[nodiscard]] int run_calibrate_imu(const CalibrateImuArguments& arguments,
                                    const Terminal& terminal);

/// Kalibr's imu.yaml, as read_kalibr_imu reads it; comments say what is a bound only.
[[nodiscard]] std::string to_kalibr_imu(const StaticImuNoise& result, const std::string& heading);

}  // namespace fiducap
