#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_check.hpp"
#include "base/pose.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::vrpn {

/// An additional sensor of a body: point and axes, fixed to the body's pivot.
struct ExtraSensor {
  std::string body;  ///< Name.
  Pose X_PS;         ///< Pose of the sensor in axes of the pivot.
};

struct VrpnConfig {
  static constexpr int kMaxSensors = 5;  ///< Per body: their reports share a datagram.

  bool enabled{true};                ///< False: this protocol is not served.
  std::string address{"127.0.0.1"};  ///< IPv4 only. 0.0.0.0: all interfaces.
  std::uint16_t port{3883};          ///< TCP and UDP. 0: any free one.
  int max_clients{64};               ///< Further clients are refused.
  bool udp_reports{true};            ///< False: everything by TCP (firewalls).
  bool velocity{true};               ///< Also send velocities.
  bool acceleration{false};          ///< Also send accelerations.
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  NameAliases aliases{};  ///< Names for clients, by name of the body; rules as for names of bodies.
  int minor_version{35};  ///< In the cookie `vrpn: ver. 07.<minor>`.
  std::array<double, 6> workspace_box_m{-10, -10, 0, 10, 10, 5};  ///< min x y z, max x y z, W axes.

  std::vector<ExtraSensor> sensors{};  ///< Sensors 1, 2, … of their bodies; 0 is the pivot.

  /// Of one body, without sensor 0.
  [[nodiscard]] std::vector<Pose> sensors_of(std::string_view body) const;
  [[nodiscard]] OutputAxes axes() const { return {up, scope, 1.0}; }
  [[nodiscard]] std::vector<ConfigError> check() const;
  [[nodiscard]] ServedProtocol served() const;
};

template <class V>
void describe(V& v, ExtraSensor& c) {
  v.value("body", c.body);
  v.value("X_PS", c.X_PS);
}

template <class V>
void describe(V& v, VrpnConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("max_clients", c.max_clients);
  v.value("udp_reports", c.udp_reports);
  v.value("velocity", c.velocity);
  v.value("acceleration", c.acceleration);
  v.word("up", c.up, words::kUpAxis);
  v.word("scope", c.scope, words::kAxesScope);
  v.value("aliases", c.aliases);
  v.value("minor_version", c.minor_version);
  v.value("workspace_box_m", c.workspace_box_m);
  v.list("sensors", c.sensors);
}

using ProtocolConfig = VrpnConfig;

/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const VrpnConfig& config);

}  // namespace fiducap::vrpn
