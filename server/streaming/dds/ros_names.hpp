#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/client_names.hpp"

namespace fiducap::dds {

/// What ROS allows in one part of a topic's name: a letter first, then letters, digits, single
/// underscores.
[[nodiscard]] bool is_ros_name(std::string_view name);
/// `/a` or `/a/b`.
[[nodiscard]] bool is_ros_namespace(std::string_view name);
/// tf2: not empty, no leading slash, nothing that needs quoting.
[[nodiscard]] bool is_ros_frame(std::string_view name);

/// The bodies' names in ROS, in their order: what the conventions allow, and a letter first.
/// Distinct.
[[nodiscard]] std::vector<std::string> ros_names(const SceneModel& model,
                                                 const NameAliases& aliases = {});

}  // namespace fiducap::dds
