#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// Sets the lens the way calibration files name it: `none`; `radial-tangential`, `radtan`,
/// `plumb_bob`; `equidistant`, `equi`, `fisheye`. OpenCV's longer lists are taken when what we do
/// not model is zero.
/// @return Error for other models or another number of coefficients
[[nodiscard]] Expected<void> set_lens(CameraModel& camera, const std::string& name,
                                      const std::vector<double>& coefficients);

/// The name EuRoC uses.
[[nodiscard]] std::string name_of(Distortion distortion);

}  // namespace fiducap
