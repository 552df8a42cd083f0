#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

class YamlSection;

/// Sets the distortion by the names of calibration files: `none`; `radial-tangential`, `radtan`,
/// `plumb_bob`; `equidistant`, `equi`, `fisheye`. Longer lists are accepted when the rest is zero.
/// @return Error for other models or another number of coefficients
[[nodiscard]] Expected<void> set_lens(CameraModel& camera, const std::string& name,
                                      const std::vector<double>& coefficients);

/// The name EuRoC uses.
[[nodiscard]] std::string name_of(Distortion distortion);

/// The intrinsics fu fv cu cv as EuRoC and Kalibr write them. Faults are collected in `yaml`.
/// @param coefficients_key  `distortion_coefficients` (EuRoC) or `distortion_coeffs` (Kalibr)
[[nodiscard]] CameraModel read_pinhole(const YamlSection& yaml,
                                       const std::string& coefficients_key);

/// Sigmas of the lens, if given: `intrinsics_sigma: {focal, centre_px, k1}` and `lens_error_px`.
void read_lens_sigmas(const YamlSection& yaml, CameraMount& mount);

/// Reads the intrinsics of one camera. The format is recognised by its keys:
///   - EuRoC: `intrinsics`, `resolution`, `distortion_model`, `distortion_coefficients`
///   - OpenCV and ROS: `camera_matrix`, `distortion_coefficients`, `image_width`, `image_height`
///   - JSON: `width`, `height`, `K`, `dist_k1k2p1p2k3`
///   - JSON like WPILib's: `camera_matrix`, `distortion_coefficients`, `resolution` or `img_size`
/// Four coefficients without a model name are refused: they fit OpenCV's lens and its fisheye.
[[nodiscard]] Expected<CameraModel> read_camera_calibration(const std::string& path);
/// The same with the sigmas of the lens (read_lens_sigmas); the rest of the mount is kept.
[[nodiscard]] Expected<CameraMount> read_camera_calibration(const std::string& path,
                                                            CameraMount mount);

/// Reads a Kalibr camchain YAML (`cam0`, …) with `timeshift_cam_imu`. Kalibr's `T_cam_imu` takes
/// IMU axes to camera axes, so X_BV = T_cam_imu⁻¹; OpenVINS' `T_imu_cam` is its inverse.
[[nodiscard]] Expected<std::vector<CameraMount>> read_kalibr_camchain(const std::string& path);

/// Reads a Kalibr imu.yaml (`accelerometer_noise_density` …, `update_rate`), flat or below `imu0`.
[[nodiscard]] Expected<ImuNoise> read_kalibr_imu(const std::string& path);

}  // namespace fiducap
