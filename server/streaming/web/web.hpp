#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "streaming/operator_api.hpp"
#include "streaming/page_api.hpp"
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

  bool enabled{true};
  std::string address{"127.0.0.1"};
  std::uint16_t port{8080};  ///< 0: any free port, see Streamer::port.
  double rate_hz{20.0};      ///< Frames to a page.
  int max_clients{32};       ///< Live pages at once.
  /// Host names of this server for browsers, besides this machine's name and addresses.
  std::vector<std::string> hosts;
  ViewRule camera_views{ViewRule::kOperator};
  std::string root;  ///< Folder of the page bundle; empty: beside the program.

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

/// @return pictures may be requested
[[nodiscard]] inline bool shows_cameras(const WebConfig& config) {
  return config.enabled && config.camera_views != ViewRule::kOff;
}

using ProtocolConfig = WebConfig;

/// Data for the page besides frames.
struct WebSources {
  /// Of all protocols; called on the pages' thread, once a second and for each new page.
  std::function<std::vector<ClientStatus>()> clients;
  std::string server_name{"fiducapd"};
  std::string version;
  std::function<std::string()> map_mode;  ///< Current: `mapping` or `frozen`.
  const EventBoard* events{};             ///< nullptr: no events.
  OperatorApi* operator_api{};            ///< nullptr: no commands.
  CameraViews* views{};                   ///< nullptr: no pictures.
  SetupApi* setup{};                      ///< nullptr: no set-up is running.
  /// Called once a second.
  std::function<std::vector<TagFit>()> tag_fits{};
  /// As OperatorApi::map_versions and map_version; empty: no store.
  std::function<std::vector<MapVersionInfo>()> map_versions{};
  std::function<Expected<std::shared_ptr<const TagMap>>(std::int64_t)> map_version{};
};

/// HTTP (page, `/api/v1/state` JSON, `/healthz`, `/metrics`) and WebSockets (`/api/v1/live`:
/// frames;
/// `/api/v1/control`: commands with the operator's token; `/api/v1/views`: pictures of cameras),
/// same origin.
/// @return Error with a remedy when the address cannot be bound
[[nodiscard]] StartedStreamer start_web_server(boost::asio::io_context& io, const WebConfig& config,
                                               WebSources sources,
                                               std::shared_ptr<const SceneModel> model,
                                               const Clock& clock);

/// For the list of protocols (streaming/CMakeLists.txt).
[[nodiscard]] inline StartedStreamer serve(const ProtocolContext& context,
                                           const WebConfig& config) {
  WebSources sources;
  sources.clients = context.clients;
  sources.version = context.version;
  sources.events = &context.events;
  sources.operator_api = &context.operator_api;
  sources.views = context.views;
  sources.setup = context.setup;
  sources.map_mode = [&api = context.operator_api] {
    return std::string(api.map_mode() == MapMode::kFrozen ? "frozen" : "mapping");
  };
  sources.tag_fits = [&api = context.operator_api] { return api.tag_fits(); };
  sources.map_versions = [&api = context.operator_api] { return api.map_versions(); };
  sources.map_version = [&api = context.operator_api](std::int64_t version) {
    return api.map_version(version);
  };
  return start_web_server(context.io, config, std::move(sources), context.model, context.clock);
}

}  // namespace fiducap::web
