#include "streaming/web/web_server.hpp"

#include <utility>

#include "base/log.hpp"
#include "streaming/net/tcp_server.hpp"
#include "streaming/web/web_session.hpp"

namespace fiducap::web {

namespace {

// Besides the live sockets: files of a page being loaded, programs asking for the state.
constexpr int kPlainConnections = 64;
constexpr std::string_view kKey = "streaming.web";

/// A page that reads too slowly loses frames, then its connection.
class PageServer final : public Streamer {
 public:
  PageServer(boost::asio::io_context& io, std::shared_ptr<WebDesk> desk, const WebConfig& config,
             const Clock& clock)
      : desk_(std::move(desk)),
        tcp_(io, {"web", config.max_clients + kPlainConnections, 0, kKey}, clock) {}

  Expected<void> listen(const WebConfig& config) {
    const auto port = tcp_.listen({config.address, config.port, kKey},
                                  [desk = desk_](net::Socket socket, const net::Peer& peer) {
                                    return make_session(std::move(socket), peer, desk);
                                  });
    if (!port) return tl::unexpected(port.error());
    port_ = *port;
    tcp_.start([this](Instant now) {
      desk_->feed().tick(now);
      desk_->view_feed().tick(now);
      pump_all();
    });
    return {};
  }

  [[nodiscard]] std::string_view protocol() const override { return "web"; }
  [[nodiscard]] std::uint16_t port() const override { return port_; }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    desk_->feed().publish(frame);
    desk_->feed().tick(desk_->now());
    desk_->view_feed().tick(desk_->now());
    pump_all();
  }
  void append_clients(std::vector<ClientStatus>& out) const override {
    for (const auto& connection : desk_->feed().connections())
      out.push_back(connection->status(desk_->now()));
    for (const auto& viewer : desk_->view_feed().connections())
      out.push_back(viewer->status(desk_->now()));
  }
  void stop() override { tcp_.stop(); }

 private:
  void pump_all() {
    tcp_.each<WebSession>([](WebSession& session) { session.pump(); });
  }

  std::shared_ptr<WebDesk> desk_;
  std::uint16_t port_{0};
  net::TcpServer tcp_;
};

}  // namespace

Expected<std::unique_ptr<WebServer>> start_web_server(boost::asio::io_context& io,
                                                      const WebConfig& config, WebSources sources,
                                                      std::shared_ptr<const SceneModel> model,
                                                      const Clock& clock) {
  auto desk = std::make_shared<WebDesk>(config, std::move(sources), std::move(model), clock);
  if (!desk->has_page()) {
    log::warning(
        "web", "no page bundle in " + page_root(config.root).string() + ": only the API is served");
  }
  auto server = std::make_unique<PageServer>(io, std::move(desk), config, clock);
  if (const auto listening = server->listen(config); !listening)
    return tl::unexpected(listening.error());
  const bool is_v6 = config.address.find(':') != std::string::npos;
  const std::string host = is_v6 ? "[" + config.address + "]" : config.address;
  log::info("web", "page at http://" + host + ":" + std::to_string(server->port()) + "/");
  return server;
}

}  // namespace fiducap::web
