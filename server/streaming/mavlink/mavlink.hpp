#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::mavlink {

/// Which message carries the pose.
enum class PoseMessage { kOdometry, kVisionPosition, kBoth };

/// One autopilot and its body.
struct VehicleConfig {
  std::string body;                  ///< Name of its body.
  std::string address{"127.0.0.1"};  ///< Of the autopilot.
  std::uint16_t port{14580};  ///< PX4's "onboard" port in simulation; ArduPilot: usually 14550.
  PoseMessage message{PoseMessage::kOdometry};
  /// ArduPilot takes frd only; ned: the workspace's y points north.
  AutopilotWorld world{AutopilotWorld::kFrd};
  double rate_hz{40};     ///< Poses per second to this autopilot, at most.
  int system_id{1};       ///< Ours: that of the autopilot, as part of its vehicle.
  int component_id{197};  ///< MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY.
};

struct MavlinkConfig {
  bool enabled{false};             ///< False: this protocol is not served.
  std::string address{"0.0.0.0"};  ///< UDP, ours. Only configured autopilots are heard.
  std::uint16_t port{0};           ///< 0: any free one; autopilots reply to it.
  std::vector<VehicleConfig> vehicles;

  [[nodiscard]] std::vector<ConfigError> check() const;
  /// Rules between vehicles and bodies.
  [[nodiscard]] std::vector<ConfigError> check_bodies(const std::vector<std::string>& names) const;
  [[nodiscard]] ServedProtocol served() const;
};

inline constexpr std::array<words::Word<PoseMessage>, 3> kPoseMessage{
    {{"odometry", PoseMessage::kOdometry},
     {"vision-position", PoseMessage::kVisionPosition},
     {"both", PoseMessage::kBoth}}};

template <class V>
void describe(V& v, VehicleConfig& c) {
  v.value("body", c.body);
  v.value("address", c.address);
  v.value("port", c.port);
  v.word("message", c.message, kPoseMessage);
  v.word("world", c.world, words::kAutopilotWorld);
  v.value("rate_hz", c.rate_hz);
  v.value("system_id", c.system_id);
  v.value("component_id", c.component_id);
}

template <class V>
void describe(V& v, MavlinkConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.list("vehicles", c.vehicles);
}

using ProtocolConfig = MavlinkConfig;

/// Sends poses to autopilots by one UDP socket.
/// @return Error `kUnavailable` naming port and remedy when it cannot bind
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const MavlinkConfig& config);

}  // namespace fiducap::mavlink
