#include <utility>

#include "base/log.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/net/tcp_server.hpp"
#include "streaming/vicon/frame_board.hpp"
#include "streaming/vicon/session.hpp"
#include "streaming/vicon/vicon.hpp"

namespace fiducap::vicon {

namespace {

constexpr std::string_view kKey = "streaming.vicon";

/// Offers each frame to all sessions.
class ViconServer final : public Streamer {
 public:
  ViconServer(const ProtocolContext& context, const ViconConfig& config)
      : Streamer("vicon"),
        context_(std::make_shared<SessionContext>(config, context.clock)),
        tcp_(context.io, {"vicon", config.max_clients, config.max_clients_per_address, kKey},
             context.clock) {}

  Expected<void> listen(const ViconConfig& config) {
    const auto port = tcp_.listen({config.address, config.port, kKey},
                                  [context = context_](net::Socket socket, const net::Peer&) {
                                    return std::make_shared<Session>(std::move(socket), context);
                                  });
    if (!port) return tl::unexpected(port.error());
    port_ = *port;
    tcp_.start();
    return {};
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    if (frame->model == nullptr) return;
    context_->board.update(*frame, context_->clock.now());
    tcp_.each<Session>([](Session& session) { session.publish(); });
  }
  void append_clients(std::vector<ClientStatus>& out) const override {
    const Instant now = context_->clock.now();
    tcp_.each<Session>([&](const Session& session) {
      if (session.open()) out.push_back(session.status(now));
    });
  }
  void stop() override { tcp_.stop(); }

 private:
  std::shared_ptr<SessionContext> context_;
  net::TcpServer tcp_;
};

}  // namespace

std::vector<ConfigError> ViconConfig::check() const {
  return Checker{"streaming.vicon."}
      .require(net::parse_address(address).has_value(), "address", address,
               "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
      .within("max_clients", max_clients, 1, 256)
      .within("max_clients_per_address", max_clients_per_address, 1, 256)
      .errors;
}

ServedProtocol ViconConfig::served() const {
  return {"vicon", enabled, address, {{port, false}}, conventions_of("vicon").axes, when_invalid};
}

StartedStreamer serve(const ProtocolContext& context, const ViconConfig& config) {
  auto server = std::make_unique<ViconServer>(context, config);
  if (auto listening = server->listen(config); !listening) return tl::unexpected(listening.error());
  log::info("vicon", "serves the Vicon DataStream on " + config.address + ":" +
                         std::to_string(server->port()) + " (TCP)");
  return server;
}

}  // namespace fiducap::vicon
