#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"

namespace YAML {
class Node;
}

namespace fiducap {

/// A calibration that is no YAML, as the YAML of the same content: OpenCV's XML, ROS' ost.ini
/// (keys of OpenCV), COLMAP's cameras.txt (a list `calibrations`), DSO's camera.txt (keys of
/// EuRoC). Unusable parts are left out.
/// @return nullopt for any other text
[[nodiscard]] std::optional<YAML::Node> calibration_node(std::string_view text);

class YamlSection;

/// The intrinsics fu fv cu cv as EuRoC and Kalibr write them. Faults are collected in `yaml`.
/// @param coefficients_key  `distortion_coefficients` (EuRoC) or `distortion_coeffs` (Kalibr)
[[nodiscard]] CameraModel read_pinhole(const YamlSection& yaml,
                                       const std::string& coefficients_key);

/// Sigmas of the lens, if given: `intrinsics_sigma: {focal, centre_px, k1}` and `lens_error_px`.
void read_lens_sigmas(const YamlSection& yaml, CameraMount& mount);

enum class CameraPlace {
  kUnknown,         ///< The file has the lens only.
  kBesideTheFirst,  ///< Relative to the first camera of the file, whose X_BV is that of before.
  kOnBody,
};

struct CalibratedCamera {
  CameraMount mount;
  CameraPlace place{CameraPlace::kUnknown};
};

/// Reads the cameras of a calibration file. The format is recognised by its content:
///   - EuRoC: `intrinsics`, `resolution`, `distortion_model`, `distortion_coefficients`, with the
///     sigmas of the lens (read_lens_sigmas)
///   - OpenCV and ROS (YAML, XML, ROS' ost.ini), WPILib, PhotonVision: `camera_matrix` …
///   - Kalibr's camchain with or without an IMU, TagSLAM's cameras.yaml: `cam0` … Kalibr's
///     `T_cam_imu` takes IMU axes to camera axes, X_BV = T_cam_imu⁻¹; OpenVINS' `T_imu_cam` is X_BV
///   - Basalt's calibration.json: `value0`
///   - camodocal's and VINS': `projection_parameters`; ORB-SLAM's: `Camera.fx` …, `Camera1.fx` …
///   - mrcal's .cameramodel: `lensmodel`; DSO's camera.txt
///   - COLMAP's cameras.txt and PhotonVision's settings: several lenses; the one for images of the
///     size of `otherwise` is taken
/// Four coefficients without a model name are refused: they fit OpenCV's lens and its fisheye.
/// @param otherwise  keeps what the file does not have
[[nodiscard]] Expected<std::vector<CalibratedCamera>> read_calibration(
    const std::string& path, const CameraMount& otherwise);
/// The lens of a file of one camera.
[[nodiscard]] Expected<CameraModel> read_camera_calibration(const std::string& path);

/// Reads Kalibr's imu.yaml (`accelerometer_noise_density` …, `update_rate`; flat or below `imu0`),
/// as allan_variance_ros writes it, too, VINS' (`gyr_n` …), or the result of imu_utils (`Gyr`,
/// `Acc`: the mean of the axes), whose `gyr_w` and `acc_w` are bias instabilities: upper bounds of
/// the random walks.
[[nodiscard]] Expected<ImuNoise> read_imu_noise(const std::string& path);

}  // namespace fiducap
