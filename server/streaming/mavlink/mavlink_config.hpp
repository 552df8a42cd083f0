#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/autopilot_axes.hpp"

namespace fiducap::mavlink {

/// Which message carries the pose.
enum class PoseMessage { kOdometry, kVisionPosition, kBoth };

/// One autopilot and the body it sits on.
struct VehicleConfig {
  std::string body;
  std::string address{"127.0.0.1"};
  std::uint16_t port{
      14580};  ///< PX4's "onboard" port in simulation; ArduPilot: 14550 or as set up there.
  PoseMessage message{PoseMessage::kOdometry};
  AutopilotWorld world{
      AutopilotWorld::kFrd};  ///< ArduPilot takes frd only; ned: the workspace's y points north.
  double rate_hz{40};
  int system_id{1};       ///< Ours. The autopilot's own: we are a part of that vehicle.
  int component_id{197};  ///< MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY.
};

struct MavlinkConfig {
  bool enabled{false};
  std::string address{
      "0.0.0.0"};  ///< UDP, ours: where autopilots answer to. Only those configured are heard.
  std::uint16_t port{0};  ///< 0: any free one; they answer to where we send from.
  std::vector<VehicleConfig> vehicles;

  [[nodiscard]] std::vector<ConfigError> check() const;
};

}  // namespace fiducap::mavlink
