#pragma once

#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

namespace YAML {
class Node;
}

namespace fiducap {

/// How the axes of an IMU's readings (S) lie in the body's axes B: x forward, y left, z up.
///
/// Written as a word, as a list that says where each body axis is found in the readings (`[y, -x,
/// z]`: forward is their y, left is their −x, up is their z), or as the quaternion q_BS, w first.
/// flu: as they come. frd: forward, right, down, as autopilots have it. camera: right, down,
/// forward, as RealSense and OAK have it.
struct ImuAxes {
  Eigen::Matrix3d R_BS{Eigen::Matrix3d::Identity()};
  std::string written{"flu"};  ///< As it stands in the configuration.

  [[nodiscard]] bool is_turned() const { return R_BS != Eigen::Matrix3d::Identity(); }
};

/// @return nullopt: neither a word, nor a right-handed choice of axes, nor a unit quaternion
[[nodiscard]] std::optional<ImuAxes> axes_from(std::span<const std::string> words);

/// For the configuration, see base/yaml_values.hpp.
[[nodiscard]] std::optional<std::string> read_value(const YAML::Node& node, ImuAxes& out);
[[nodiscard]] std::string text_of(const ImuAxes& axes);

}  // namespace fiducap
