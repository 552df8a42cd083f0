#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap::vicon {

struct ViconConfig {
  bool enabled{false};               ///< Off unless asked for: the usual port needs a permission.
  std::string address{"127.0.0.1"};  ///< IPv4: clients know no other. 0.0.0.0: all interfaces.
  std::uint16_t port{801};           ///< TCP. 0: any free one, see ViconStreamer::port.
  int max_clients{64};
  int max_clients_per_address{32};
  WhenInvalid when_invalid{conventions_of("vicon").when_invalid};
  NameAliases aliases;

  [[nodiscard]] std::vector<ConfigError> check() const;
};

}  // namespace fiducap::vicon
