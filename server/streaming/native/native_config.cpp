#include "streaming/native/native_config.hpp"

#include <boost/asio/ip/address.hpp>

namespace fiducap::native {

std::vector<ConfigError> NativeConfig::check() const {
  namespace ip = boost::asio::ip;
  boost::system::error_code address_error;
  boost::system::error_code group_error;
  boost::system::error_code interface_error;
  ip::make_address(address, address_error);
  const auto group = ip::make_address_v4(multicast_group, group_error);
  ip::make_address_v4(multicast_interface, interface_error);
  return Checker{"streaming.native."}
      .require(!address_error, "address", address,
               "must be an IP address, e.g. 127.0.0.1 or 0.0.0.0")
      .within("max_clients", max_clients, 1, 1024)
      .within("max_clients_per_address", max_clients_per_address, 1, 1024)
      .within("lease_s", lease_s, 0.5, 60)
      .require(multicast_group.empty() || (!group_error && group.is_multicast()), "multicast_group",
               multicast_group, "must be an IPv4 multicast address, e.g. 239.255.42.16, or empty")
      .require(multicast_group.empty() || multicast_port != 0, "multicast_port",
               std::to_string(multicast_port), "must not be 0")
      .within("multicast_ttl", multicast_ttl, 0, 255)
      .require(multicast_interface.empty() || !interface_error, "multicast_interface",
               multicast_interface, "must be an IPv4 address of this machine, or empty")
      .errors;
}

}  // namespace fiducap::native
