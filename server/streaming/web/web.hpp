#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::web {

/// Clients that may see pictures of cameras.
enum class ViewRule {
  kOff,
  kLoopback,  ///< Clients at the machine itself.
  kOperator,  ///< … and operators.
  kEveryone,
};

inline constexpr std::array<fiducap::words::Word<ViewRule>, 4> kViewRules{
    {{"off", ViewRule::kOff},
     {"loopback", ViewRule::kLoopback},
     {"operator", ViewRule::kOperator},
     {"everyone", ViewRule::kEveryone}}};

struct WebConfig {
  /// Pages are served on their own thread, which may be late.
  static constexpr bool kCanWait = true;

  bool enabled{true};                ///< False: this protocol is not served.
  std::string address{"127.0.0.1"};  ///< Where it listens. 0.0.0.0: all interfaces.
  std::uint16_t port{8080};          ///< 0: any free port.
  double rate_hz{20.0};              ///< Frames to a page.
  int max_clients{32};               ///< Live pages at once.
  /// Host names of this server for browsers, besides this machine's name and addresses.
  std::vector<std::string> hosts;
  ViewRule camera_views{ViewRule::kOperator};
  std::string root;  ///< Folder of the page bundle; empty: beside the program.

  [[nodiscard]] std::vector<ConfigError> check() const;
  [[nodiscard]] ServedProtocol served() const { return {"web", enabled, address, {{port}}, {}}; }
};

template <class V>
void describe(V& v, WebConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("rate_hz", c.rate_hz);
  v.value("max_clients", c.max_clients);
  v.value("hosts", c.hosts);
  v.word("camera_views", c.camera_views, kViewRules);
  v.path("root", c.root);
}

/// @return pictures may be requested
[[nodiscard]] inline bool shows_cameras(const WebConfig& config) {
  return config.enabled && config.camera_views != ViewRule::kOff;
}

using ProtocolConfig = WebConfig;

/// HTTP (page, `/api/v1/state` JSON, `/healthz`, `/metrics`) and WebSockets (`/api/v1/live`:
/// frames;
/// `/api/v1/control`: commands with the operator's token; `/api/v1/views`: pictures of cameras),
/// same origin. Without an OperatorApi there are no commands and no versions of the map.
/// @return Error with a remedy when the address cannot be bound
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const WebConfig& config);

}  // namespace fiducap::web
