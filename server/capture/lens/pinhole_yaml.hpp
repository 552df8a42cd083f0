#pragma once

#include <string>

#include "base/yaml_section.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// The intrinsics as EuRoC and Kalibr write them: `camera_model`, `resolution`, `intrinsics` (fu fv
/// cu cv), `distortion_model`. What is wrong with them is collected in `yaml`.
/// @param coefficients_key  `distortion_coefficients` (EuRoC) or `distortion_coeffs` (Kalibr)
[[nodiscard]] CameraModel read_pinhole(const YamlSection& yaml,
                                       const std::string& coefficients_key);

/// How far the lens may be off, where the file says so: `intrinsics_sigma: {focal, centre_px, k1}`
/// and `lens_error_px`, as `fiducap calibrate camera` and recordings have them.
void read_lens_sigmas(const YamlSection& yaml, CameraMount& mount);

/// Adds the rules that `model` breaks to the faults of `yaml`, unless it has some already.
void check_model(const YamlSection& yaml, const CameraModel& model);

/// A number of pixels as written; out of range stays out of range.
[[nodiscard]] int pixels_of(double number);

}  // namespace fiducap
