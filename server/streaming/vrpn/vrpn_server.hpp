#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "streaming/axes.hpp"
#include "streaming/streamer.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::vrpn {

struct VrpnConfig {
  bool enabled{true};
  std::string address{"127.0.0.1"};
  std::uint16_t port{3883};          ///< TCP and UDP.
  int max_clients{64};
  bool udp_reports{true};            ///< False: everything by TCP (firewalls).
  bool velocity{true};
  bool acceleration{false};
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  int minor_version{35};             ///< In the cookie `vrpn: ver. 07.<minor>`.
  std::array<double, 6> workspace_box_m{-10, -10, 0, 10, 10, 5};  ///< min x y z, max x y z.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] Expected<std::unique_ptr<Streamer>> start_vrpn_server(boost::asio::io_context& io,
                                                                     const VrpnConfig& config,
                                                                     std::shared_ptr<const SceneModel> model,
                                                                     const Clock& clock);

}  // namespace fiducap::vrpn
