#include "streaming/vicon/vicon_config.hpp"

#include <arpa/inet.h>

namespace fiducap::vicon {

std::vector<ConfigError> ViconConfig::check() const {
  in_addr parsed{};
  const bool is_ipv4 = ::inet_pton(AF_INET, address.c_str(), &parsed) == 1;
  return Checker{"streaming.vicon."}
      .require(is_ipv4, "address", address, "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
      .within("max_clients", max_clients, 1, 256)
      .within("max_clients_per_address", max_clients_per_address, 1, 256)
      .errors;
}

}  // namespace fiducap::vicon
