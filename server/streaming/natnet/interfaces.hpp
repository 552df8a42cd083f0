#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "streaming/natnet/natnet_config.hpp"

namespace fiducap::natnet {

/// Where else DISCOVERY by broadcast arrives when only `address` is listened on: its subnet's broadcast address, and
/// 255.255.255.255 unless it is the loopback. Empty for 0.0.0.0, which hears everything.
[[nodiscard]] std::vector<std::string> broadcast_addresses(const std::string& address);

/// The address of the card that multicast frames leave by: the one configured, or the one listened on, or the only one.
/// @return Error naming the choices when there are several: guessing wrong looks like "nothing arrives"
[[nodiscard]] Expected<std::uint32_t> multicast_interface(const NatNetConfig& config);

}  // namespace fiducap::natnet
