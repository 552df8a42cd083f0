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

namespace fiducap::vrpn {

/// One more sensor of a body: a point and axes of its own, fixed to the body's pivot.
struct ExtraSensor {
  std::string body;  ///< Name.
  Pose X_PS;
};

struct VrpnConfig {
  static constexpr int kMaxSensors = 5;  ///< Per body: their reports share a datagram.

  bool enabled{true};
  std::string address{"127.0.0.1"};  ///< IPv4; VRPN knows no other. 0.0.0.0: all interfaces.
  std::uint16_t port{3883};          ///< TCP and UDP. 0: any free one, see VrpnStreamer::port.
  int max_clients{64};
  bool udp_reports{true};  ///< False: everything by TCP (firewalls).
  bool velocity{true};
  bool acceleration{false};
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  NameAliases aliases{};  ///< An alias must obey the rules of a body's name here.
  int minor_version{35};  ///< In the cookie `vrpn: ver. 07.<minor>`.
  std::array<double, 6> workspace_box_m{-10, -10, 0, 10, 10, 5};  ///< min x y z, max x y z, W axes.

  std::vector<ExtraSensor>
      sensors{};  ///< Sensors 1, 2, … of their bodies in this order; 0 is the pivot.

  /// Those of one body, without sensor 0.
  [[nodiscard]] std::vector<Pose> sensors_of(std::string_view body) const;
  [[nodiscard]] OutputAxes axes() const { return {up, scope, 1.0}; }
  [[nodiscard]] std::vector<ConfigError> check() const;
};

}  // namespace fiducap::vrpn
