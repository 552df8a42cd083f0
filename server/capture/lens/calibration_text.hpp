#pragma once

#include <optional>
#include <string_view>

#include <yaml-cpp/yaml.h>

namespace fiducap {

/// A calibration that is no YAML, as the YAML of the same content: OpenCV's XML, ROS' ost.ini
/// (keys of OpenCV), COLMAP's cameras.txt (`cam0` … as Kalibr). Unusable parts are left out.
/// @return nullopt for any other text
[[nodiscard]] std::optional<YAML::Node> calibration_node(std::string_view text);

}  // namespace fiducap
