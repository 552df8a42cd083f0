#include "base/log.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/net/tcp_server.hpp"
#include "streaming/web/web.hpp"
#include "streaming/web/web_session.hpp"

namespace fiducap::web {

namespace {

// Besides live sockets: loading pages, programs that read the state.
constexpr int kPlainConnections = 64;
constexpr std::string_view kKey = "streaming.web";

/// Slow pages lose frames, then their connection.
class PageServer final : public Streamer {
 public:
  PageServer(const ProtocolContext& context, const WebConfig& config)
      : Streamer("web"),
        context_(std::make_shared<WebContext>(context, config)),
        tcp_(context.io, {"web", config.max_clients + kPlainConnections, 0, kKey}, context.clock) {
    if (!context_->has_page())
      log::warning("web", "no page bundle in " + page_root(config.root).string() +
                              ": only the API is served");
  }

  Expected<void> listen(const WebConfig& config) {
    const auto port = tcp_.listen({config.address, config.port, kKey},
                                  [context = context_](net::Socket socket, const net::Peer& peer) {
                                    return make_session(std::move(socket), peer, context);
                                  });
    if (!port) return tl::unexpected(port.error());
    port_ = *port;
    tcp_.start([this](Instant now) {
      context_->feed().tick(now);
      context_->view_feed().tick(now);
      pump_all();
    });
    return {};
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    context_->feed().publish(frame);
    context_->feed().tick(context_->now());
    context_->view_feed().tick(context_->now());
    pump_all();
  }
  void append_clients(std::vector<ClientStatus>& out) const override {
    for (const auto& connection : context_->feed().connections())
      out.push_back(connection->status(context_->now()));
    for (const auto& viewer : context_->view_feed().connections())
      out.push_back(viewer->status(context_->now()));
  }
  void stop() override { tcp_.stop(); }

 private:
  void pump_all() {
    tcp_.each<WebSession>([](WebSession& session) { session.pump(); });
  }

  std::shared_ptr<WebContext> context_;
  net::TcpServer tcp_;
};

}  // namespace

std::vector<ConfigError> WebConfig::check() const {
  return Checker{"streaming.web."}
      .require(net::is_address(address), "address", address,
               "must be an IP address, e.g. 127.0.0.1")
      .within("rate_hz", rate_hz, 0.5, 60)
      .within("max_clients", max_clients, 1, 1000)
      .errors;
}

StartedStreamer serve(const ProtocolContext& context, const WebConfig& config) {
  auto server = std::make_unique<PageServer>(context, config);
  if (const auto listening = server->listen(config); !listening)
    return tl::unexpected(listening.error());
  const bool is_v6 = config.address.find(':') != std::string::npos;
  const std::string host = is_v6 ? "[" + config.address + "]" : config.address;
  log::info("web", "page at http://" + host + ":" + std::to_string(server->port()) + "/");
  return server;
}

}  // namespace fiducap::web
