#include "daemon/protocol_servers.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/log.hpp"
#include "streaming/protocol_servers.hpp"

namespace fiducap {

namespace {

ProtocolContext context_in(StreamLoop& loop, StreamLoop& other, const ProtocolParts& parts) {
  const auto clients = [&own = loop.hub(), &other = other.hub()] {
    std::vector<ClientStatus> all = *other.shown_clients();
    for (auto& client : own.clients()) all.push_back(std::move(client));
    return all;
  };
  return {loop.io(),       parts.model,    parts.desk,
          parts.events,    parts.clock,    parts.config.streaming.rate_hz,
          FIDUCAP_VERSION, parts.join_dds, clients,
          parts.views,     parts.setup};
}

}  // namespace

Expected<ServerPorts> start_protocols(const ProtocolParts& parts) {
  const StreamingConfig& streaming = parts.config.streaming;
  const ProtocolContext in_frames = context_in(parts.frames, parts.pages, parts);
  const ProtocolContext in_pages = context_in(parts.pages, parts.frames, parts);
  ServerPorts ports;
  std::optional<Error> failure;
  for_each_protocol(
      [&](std::string_view name, const auto& config, std::uint16_t& port) {
        if (!config.enabled || failure) return;
        constexpr bool can_wait = requires { config.kCanWait; };
        auto server = serve(can_wait ? in_pages : in_frames, config);
        if (server) {
          port = (*server)->port();
          return (can_wait ? parts.pages : parts.frames).hub().add(std::move(*server));
        }
        const auto& optional = streaming.optional;
        if (std::find(optional.begin(), optional.end(), name) == optional.end()) {
          failure = server.error();
        } else {
          log::warning(name, "not served: " + server.error().text());
        }
      },
      streaming, ports);
  if (failure) return tl::unexpected(*failure);
  return ports;
}

std::vector<ServedProtocol> served_protocols(const StreamingConfig& streaming) {
  std::vector<ServedProtocol> all;
  for_each_protocol(
      [&all](std::string_view, const auto& config) {
        if constexpr (requires { config.served(); }) all.push_back(config.served());
      },
      streaming);
  return all;
}

}  // namespace fiducap
