#pragma once

#include <string>

#include "base/expected.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// Reads the intrinsics of one camera. The format is recognised by its keys, never by the name of
/// the file:
///   - EuRoC `sensor.yaml`: `intrinsics`, `resolution`, `distortion_model`,
///   `distortion_coefficients`
///   - OpenCV and ROS camera_info YAML: `camera_matrix`, `distortion_coefficients`, `image_width`,
///   `image_height`
///   - JSON: `width`, `height`, `K`, `dist_k1k2p1p2k3`
///   - JSON like WPILib's: `camera_matrix`, `distortion_coefficients`, `resolution` or `img_size`
/// Four coefficients without a model name are refused: they could be OpenCV's normal lens or its
/// fisheye.
[[nodiscard]] Expected<CameraModel> read_camera_calibration(const std::string& path);
/// The same, and how far it may be off, where the file says so (read_lens_sigmas). The rest of the
/// mount stays.
[[nodiscard]] Expected<CameraMount> read_camera_calibration(const std::string& path,
                                                            CameraMount mount);

}  // namespace fiducap
