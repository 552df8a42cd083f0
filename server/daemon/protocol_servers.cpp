#include "daemon/protocol_servers.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/log.hpp"
#include "streaming/protocol_servers.hpp"

namespace fiducap {

Expected<ServerPorts> start_protocols(const ProtocolParts& parts, StreamHub& hub) {
  const StreamingConfig& streaming = parts.config.streaming;
  const ProtocolContext context{parts.io,        parts.model,    parts.desk,
                                parts.events,    parts.clock,    streaming.rate_hz,
                                FIDUCAP_VERSION, parts.join_dds, [&hub] { return hub.clients(); }};
  ServerPorts ports;
  std::optional<Error> failure;
  for_each_protocol(
      [&](std::string_view name, const auto& config, std::uint16_t& port) {
        if (!config.enabled || failure) return;
        auto server = serve(context, config);
        if (server) {
          port = (*server)->port();
          return hub.add(std::move(*server));
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
