#pragma once

#include <string>
#include <vector>

#include "capture/recording/recording.hpp"

namespace fiducap {

/// The texts of a recording's YAML files, as read_recording_info reads them.
[[nodiscard]] std::string camera_yaml(const CameraMount& mount);
[[nodiscard]] std::string imu_yaml(const RecordingInfo& info);
[[nodiscard]] std::string tags_yaml(const RecordingInfo& info);
[[nodiscard]] std::string extrinsics_yaml(const std::vector<Pose>& X_BV);

}  // namespace fiducap
