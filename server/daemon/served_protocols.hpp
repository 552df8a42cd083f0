#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/config/config_file.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/validity.hpp"

namespace fiducap {

struct PortUse {
  std::uint16_t number{};
  bool udp{};
};

/// One protocol of a configuration: where it listens and in which axes it speaks. The rest of its
/// conventions are in streaming/conventions/protocol_conventions.hpp.
struct ServedProtocol {
  std::string_view name;
  bool enabled{};
  std::string address;
  std::vector<PortUse> ports;  ///< 0: any free one.
  OutputAxes axes;
  WhenInvalid when_invalid{WhenInvalid::kFlag};
};

[[nodiscard]] std::vector<ServedProtocol> served_protocols(const StreamingConfig& streaming);

}  // namespace fiducap
