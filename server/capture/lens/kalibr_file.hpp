#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// Reads a Kalibr camchain YAML (`cam0`, `cam1`, …). Kalibr's `T_cam_imu` takes IMU axes to camera
/// axes, so X_BV = T_cam_imu⁻¹; OpenVINS' `T_imu_cam` is accepted as its inverse, never guessed.
/// `timeshift_cam_imu` is taken over.
[[nodiscard]] Expected<std::vector<CameraMount>> read_kalibr_camchain(const std::string& path);

/// Reads a Kalibr imu.yaml (`accelerometer_noise_density` …, `update_rate`), flat or below `imu0`.
[[nodiscard]] Expected<ImuNoise> read_kalibr_imu(const std::string& path);

}  // namespace fiducap
