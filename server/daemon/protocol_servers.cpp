#include "daemon/protocol_servers.hpp"

#include <algorithm>
#include <utility>

#include "base/log.hpp"
#include "streaming/dds/dds_server.hpp"
#include "streaming/mavlink/mavlink_server.hpp"
#include "streaming/native/native_server.hpp"
#include "streaming/natnet/natnet_server.hpp"
#include "streaming/qualisys/qualisys_server.hpp"
#include "streaming/vicon/vicon_server.hpp"
#include "streaming/vrpn/vrpn_server.hpp"
#include "streaming/web/web_server.hpp"

namespace fiducap {

namespace {

using Started = Expected<std::unique_ptr<Streamer>>;

class Starter final {
 public:
  Starter(const ProtocolParts& parts, StreamHub& hub)
      : parts_(parts), streaming_(parts.config.streaming), hub_(hub) {}

  /// @param start  @return a server, after its port was noted
  template <typename Start>
  void protocol(const std::string& name, bool enabled, Start start) {
    if (!enabled || failure_) return;
    Started server = start();
    if (server) return hub_.add(std::move(*server));
    const auto& optional = streaming_.optional;
    if (std::find(optional.begin(), optional.end(), name) == optional.end()) {
      failure_ = server.error();
    } else {
      log::warning(name, "not served: " + server.error().text());
    }
  }

  Started vrpn() {
    auto server = vrpn::start_vrpn_server(parts_.io, streaming_.vrpn, parts_.model, parts_.clock);
    if (server) ports_.vrpn = (*server)->port();
    return server;
  }
  Started native() {
    auto server = native::start_native_server(parts_.io, streaming_.native, parts_.model,
                                              parts_.clock, &parts_.desk);
    if (server) ports_.native = native::bound_port(**server);
    return server;
  }
  Started natnet() {
    auto server = natnet::start_natnet_server(parts_.io, streaming_.natnet, parts_.model,
                                              parts_.clock, &parts_.desk, streaming_.rate_hz);
    if (server) ports_.natnet = (*server)->port();
    return server;
  }
  Started vicon() {
    auto server = vicon::start_vicon_server(parts_.io, streaming_.vicon, parts_.clock);
    if (server) ports_.vicon = (*server)->port();
    return server;
  }
  Started qualisys() {
    auto server = qualisys::start_qualisys_server(parts_.io, streaming_.qualisys, &parts_.desk,
                                                  parts_.model, parts_.clock);
    if (server) ports_.qualisys = (*server)->base_port();
    return server;
  }
  Started dds() {
    auto participant = parts_.join_dds();
    if (!participant) return tl::unexpected(participant.error());
    return dds::start_dds_server(*participant, streaming_.dds, parts_.model, parts_.clock);
  }
  Started mavlink() {
    return mavlink::start_mavlink_server(parts_.io, streaming_.mavlink, parts_.model, parts_.clock);
  }
  Started web() {
    web::WebSources sources;
    sources.clients = [&hub = hub_] { return hub.clients(); };
    sources.version = FIDUCAP_VERSION;
    sources.map_mode = [&desk = parts_.desk] {
      return std::string(desk.map_mode() == MapMode::kFrozen ? "frozen" : "mapping");
    };
    auto page = web::start_web_server(parts_.io, streaming_.web, std::move(sources), parts_.model,
                                      parts_.clock);
    if (page) ports_.web = (*page)->port();
    return page;
  }

  [[nodiscard]] Expected<ServerPorts> result() const {
    if (failure_) return tl::unexpected(*failure_);
    return ports_;
  }

 private:
  const ProtocolParts& parts_;
  const StreamingConfig& streaming_;
  StreamHub& hub_;
  ServerPorts ports_;
  std::optional<Error> failure_;
};

}  // namespace

const std::vector<std::string>& protocol_names() {
  static const std::vector<std::string> names{"vrpn",     "native", "natnet",  "vicon",
                                              "qualisys", "dds",    "mavlink", "web"};
  return names;
}

Expected<ServerPorts> start_protocols(const ProtocolParts& parts, StreamHub& hub) {
  const StreamingConfig& config = parts.config.streaming;
  Starter starter(parts, hub);
  starter.protocol("vrpn", config.vrpn.enabled, [&] { return starter.vrpn(); });
  starter.protocol("native", config.native.enabled, [&] { return starter.native(); });
  starter.protocol("natnet", config.natnet.enabled, [&] { return starter.natnet(); });
  starter.protocol("vicon", config.vicon.enabled, [&] { return starter.vicon(); });
  starter.protocol("qualisys", config.qualisys.enabled, [&] { return starter.qualisys(); });
  starter.protocol("dds", config.dds.enabled, [&] { return starter.dds(); });
  starter.protocol("mavlink", config.mavlink.enabled, [&] { return starter.mavlink(); });
  starter.protocol("web", config.web.enabled, [&] { return starter.web(); });
  return starter.result();
}

}  // namespace fiducap
