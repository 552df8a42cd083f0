#include "streaming/dds/dds_config.hpp"

#include "streaming/dds/ros_names.hpp"

namespace fiducap::dds {

std::vector<ConfigError> DdsConfig::check() const {
  return Checker{"streaming.dds."}
      .require(prefix.empty() || is_ros_namespace(prefix), "prefix", '"' + prefix + '"',
               "must be empty or a ROS namespace, e.g. /fiducap")
      .require(is_ros_frame(world_frame), "world_frame", '"' + world_frame + '"',
               "must be a ROS frame, e.g. world or map")
      .require(poses_deadline_hz == 0 || (poses_deadline_hz >= 1 && poses_deadline_hz <= 1000),
               "poses_deadline_hz", poses_deadline_hz, "must be 0 or in [1, 1000]")
      .within("px4_rate_hz", px4_rate_hz, 1, 1000)
      .errors;
}

}  // namespace fiducap::dds
