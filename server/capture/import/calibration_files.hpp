#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/import/import_source.hpp"

namespace fiducap {

/// Puts what calibration files say in place of what a source says: Kalibr's camchain (lens, place,
/// clock of all cameras), Kalibr's imu.yaml, or one file per camera in the order of the cameras
/// (OpenCV, ROS, EuRoC, JSON; EuRoC's with its T_BS).
/// @return Error naming the file, also when one is for another size of images
[[nodiscard]] Expected<void> apply_calibrations(const std::vector<std::string>& files,
                                                std::vector<FoundStream>& cameras,
                                                std::optional<ImuNoise>& noise);

}  // namespace fiducap
