#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"

namespace fiducap::web {

/// Who may see pictures of cameras: they show more of a room than poses do.
enum class ViewRule {
  kOff,
  kLoopback,  ///< Who sits at the machine itself.
  kOperator,  ///< … and who knows the operator's token.
  kEveryone,
};

inline constexpr std::array<fiducap::words::Word<ViewRule>, 4> kViewRules{
    {{"off", ViewRule::kOff},
     {"loopback", ViewRule::kLoopback},
     {"operator", ViewRule::kOperator},
     {"everyone", ViewRule::kEveryone}}};

struct WebConfig {
  /// Pages are served on a thread of their own, which may be late: frames of others are not.
  static constexpr bool kCanWait = true;

  bool enabled{true};
  std::string address{"127.0.0.1"};
  std::uint16_t port{8080};  ///< 0: any free port, see Streamer::port.
  double rate_hz{20.0};      ///< Frames to a page; a browser needs no more.
  int max_clients{32};       ///< Live pages at once; the next one is told to come later.
  /// Names that browsers may call this server by, beside this machine's own and its addresses.
  std::vector<std::string> hosts;
  ViewRule camera_views{ViewRule::kOperator};
  std::string root;  ///< Folder of the bundled page; empty: beside the program.

  [[nodiscard]] std::vector<ConfigError> check() const;
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

/// Pictures may be asked for.
[[nodiscard]] inline bool shows_cameras(const WebConfig& config) {
  return config.enabled && config.camera_views != ViewRule::kOff;
}

using ProtocolConfig = WebConfig;

}  // namespace fiducap::web
