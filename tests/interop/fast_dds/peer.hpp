#pragma once

#include <chrono>
#include <string>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>

/// Fast DDS as a client of ours: a separate program, since it must not share a process with Cyclone
/// DDS.
namespace fast_dds_peer {

namespace dds = eprosima::fastdds::dds;

/// `PoseStamped:rt/drone/pose:flags`; flags of b (best effort), k (transient local), d (deadline 10
/// ms).
struct WantedTopic {
  std::string type;
  std::string name;
  std::string flags;

  [[nodiscard]] bool has(char flag) const { return flags.find(flag) != std::string::npos; }
};

using Seconds = std::chrono::duration<double>;

/// Reads for this time and prints one line per topic. @return exit code
int read_topics(dds::DomainParticipant& participant, const std::vector<WantedTopic>& topics,
                Seconds duration);

/// Writes as a camera and an IMU: images of growing brightness, 20 Hz and 200 Hz, and the lens.
/// @param name  of the camera, `/cam0`: `rt/cam0/image_raw`, `rt/cam0/camera_info`, `rt/imu/data`
int write_sensors(dds::DomainParticipant& participant, const std::string& folder, Seconds duration);

}  // namespace fast_dds_peer
