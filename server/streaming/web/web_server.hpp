#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/camera_views.hpp"
#include "streaming/operator_desk.hpp"
#include "streaming/streamer.hpp"
#include "streaming/web/web_config.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::web {

/// What the page shows besides frames.
struct WebSources {
  /// Of all protocols; called on the server's thread, once a second and for each new page.
  std::function<std::vector<ClientStatus>()> clients;
  std::string server_name{"fiducapd"};
  std::string version;
  std::function<std::string()> map_mode;  ///< `mapping` or `frozen`, as it is now.
  const EventBoard* events{};             ///< nullptr: nothing is told.
  OperatorDesk* desk{};                   ///< Takes commands; nullptr: nobody does.
  CameraViews* views{};                   ///< nullptr: there are no pictures.
  SetupDesk* setup{};                     ///< nullptr: no set-up goes on.
  /// How well the map's tags are seen; called once a second.
  std::function<std::vector<TagFit>()> tag_fits{};
  /// Of the stored map, as OperatorDesk::map_versions and map_version say; empty: there are none.
  std::function<std::vector<MapVersionInfo>()> map_versions{};
  std::function<Expected<std::shared_ptr<const TagMap>>(std::int64_t)> map_version{};
};

using WebServer = Streamer;

/// HTTP (page, `/api/v1/state` JSON, `/healthz`, `/metrics`) and WebSockets (`/api/v1/live` speaks,
/// `/api/v1/control` takes commands of who knows the operator's token, `/api/v1/views` has pictures
/// of cameras), same origin.
/// @return Error with a remedy when the address cannot be bound.
[[nodiscard]] Expected<std::unique_ptr<WebServer>> start_web_server(
    boost::asio::io_context& io, const WebConfig& config, WebSources sources,
    std::shared_ptr<const SceneModel> model, const Clock& clock);

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const WebConfig& config) {
  WebSources sources;
  sources.clients = context.clients;
  sources.version = context.version;
  sources.events = &context.events;
  sources.desk = &context.desk;
  sources.views = context.views;
  sources.setup = context.setup;
  sources.map_mode = [&desk = context.desk] {
    return std::string(desk.map_mode() == MapMode::kFrozen ? "frozen" : "mapping");
  };
  sources.tag_fits = [&desk = context.desk] { return desk.tag_fits(); };
  sources.map_versions = [&desk = context.desk] { return desk.map_versions(); };
  sources.map_version = [&desk = context.desk](std::int64_t version) {
    return desk.map_version(version);
  };
  return start_web_server(context.io, config, std::move(sources), context.model, context.clock);
}

}  // namespace fiducap::web
