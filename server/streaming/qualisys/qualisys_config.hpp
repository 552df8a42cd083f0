#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/conventions/validity.hpp"

namespace fiducap::qualisys {

struct QualisysConfig {
  bool enabled{false};
  std::string address{"127.0.0.1"};  ///< IPv4. 0.0.0.0: all interfaces.
  /// TCP: this one for protocol 1.0, +1 little-endian, +2 big-endian. 0: any free ones.
  std::uint16_t base_port{22222};
  std::uint16_t discovery_port{22226};  ///< UDP, where clients ask by broadcast. 0: not answered.
  int max_clients{64};
  int max_clients_per_address{32};
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  /// `hold`: the last valid pose instead of NaN. Bodies are known by index: `stop` is `flag`.
  WhenInvalid when_invalid{WhenInvalid::kFlag};
  NameAliases aliases;
  std::string qtm_version{"2.17 (build 4050)"};  ///< What QTMVersion and discovery say.

  [[nodiscard]] OutputAxes axes() const { return {up, scope, 1000.0}; }
  [[nodiscard]] std::vector<ConfigError> check() const;
};

}  // namespace fiducap::qualisys
