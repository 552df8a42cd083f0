#include "streaming/vrpn/vrpn_config.hpp"

#include <arpa/inet.h>

#include <sstream>

namespace fiducap::vrpn {

namespace {

bool is_ipv4(const std::string& text) {
  in_addr parsed{};
  return ::inet_pton(AF_INET, text.c_str(), &parsed) == 1;
}

bool is_box(const std::array<double, 6>& box) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!std::isfinite(box[i]) || !std::isfinite(box[i + 3]) || box[i] >= box[i + 3]) return false;
  }
  return true;
}

std::string text_of(const std::array<double, 6>& box) {
  std::ostringstream text;
  for (std::size_t i = 0; i < box.size(); ++i) text << (i == 0 ? "[" : ", ") << box[i];
  return text.str() + "]";
}

}  // namespace

std::vector<ConfigError> VrpnConfig::check() const {
  return Checker{"streaming.vrpn."}
      .require(is_ipv4(address), "address", address, "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
      .within("max_clients", max_clients, 1, 256)
      .within("minor_version", minor_version, 0, 99)
      .require(is_box(workspace_box_m), "workspace_box_m", text_of(workspace_box_m),
               "must be min x y z, max x y z, finite, each min below its max")
      .errors;
}

}  // namespace fiducap::vrpn
