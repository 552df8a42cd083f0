#include "streaming/web/web_config.hpp"

#include "middleware/net/peer.hpp"

namespace fiducap::web {

std::vector<ConfigError> WebConfig::check() const {
  return Checker{"streaming.web."}
      .require(net::is_address(address), "address", address,
               "must be an IP address, e.g. 127.0.0.1")
      .within("rate_hz", rate_hz, 0.5, 60)
      .within("max_clients", max_clients, 1, 1000)
      .errors;
}

}  // namespace fiducap::web
