#include "streaming/web/web_server.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <utility>

#include "base/log.hpp"
#include "streaming/web/web_desk.hpp"
#include "streaming/web/web_session.hpp"

namespace fiducap::web {

namespace {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using tcp = asio::ip::tcp;
using ErrorCodeOf = boost::system::error_code;

// Besides the live sockets: files of a page being loaded, programs asking for the state.
constexpr std::size_t kPlainConnections = 64;
constexpr auto kTick = 1s;
constexpr auto kAcceptPause = 100ms;

Error bind_error(const WebConfig& config, const ErrorCodeOf& error) {
  const std::string context =
      "web server on " + config.address + " port " + std::to_string(config.port);
  if (error == asio::error::address_in_use) {
    return {ErrorCode::kUnavailable,
            "another program has this port; end it, or set streaming.web.port to another one (0: "
            "any free one)",
            context};
  }
  if (error == asio::error::access_denied) {
    return {ErrorCode::kUnavailable,
            "ports below 1024 need special rights; set streaming.web.port above", context};
  }
  return {ErrorCode::kUnavailable,
          error.message() + "; streaming.web.address must be an address of this machine", context};
}

}  // namespace

class WebServer::Impl final : public std::enable_shared_from_this<WebServer::Impl> {
 public:
  Impl(asio::io_context& io, std::shared_ptr<WebDesk> desk, std::size_t most_connections)
      : acceptor_(io),
        timer_(io),
        pause_(io),
        desk_(std::move(desk)),
        most_connections_(most_connections) {}

  [[nodiscard]] ErrorCodeOf listen(const tcp::endpoint& at);
  void start() {
    accept();
    tick();
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame);
  void append_clients(std::vector<ClientStatus>& out) const;
  void stop();
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  void accept();
  void on_accepted(ErrorCodeOf error, tcp::socket socket);
  void tick();
  void pump_all();

  tcp::acceptor acceptor_;
  asio::steady_timer timer_;
  asio::steady_timer pause_;
  std::shared_ptr<WebDesk> desk_;
  std::size_t most_connections_;
  std::uint16_t port_{0};
  std::vector<std::weak_ptr<WebSession>> sessions_;
};

ErrorCodeOf WebServer::Impl::listen(const tcp::endpoint& at) {
  ErrorCodeOf error;
  acceptor_.open(at.protocol(), error);
  if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor_.bind(at, error);
  if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
  if (!error) port_ = acceptor_.local_endpoint(error).port();
  return error;
}

void WebServer::Impl::accept() {
  acceptor_.async_accept([self = shared_from_this()](ErrorCodeOf error, tcp::socket socket) {
    self->on_accepted(error, std::move(socket));
  });
}

void WebServer::Impl::on_accepted(ErrorCodeOf error, tcp::socket socket) {
  if (!acceptor_.is_open()) return;
  if (error) {
    // Usually out of file descriptors: asking again at once would spin.
    pause_.expires_after(kAcceptPause);
    pause_.async_wait([self = shared_from_this()](ErrorCodeOf) {
      if (self->acceptor_.is_open()) self->accept();
    });
    return;
  }
  std::erase_if(sessions_, [](const auto& session) { return session.expired(); });
  // Above the limit the socket closes by itself here.
  if (sessions_.size() < most_connections_)
    sessions_.push_back(start_session(std::move(socket), desk_));
  accept();
}

void WebServer::Impl::publish(const std::shared_ptr<const SceneFrame>& frame) {
  desk_->feed().publish(frame);
  desk_->feed().tick(desk_->now());
  pump_all();
}

void WebServer::Impl::tick() {
  timer_.expires_after(kTick);
  timer_.async_wait([self = shared_from_this()](ErrorCodeOf error) {
    if (error || !self->acceptor_.is_open()) return;
    self->desk_->feed().tick(self->desk_->now());
    self->pump_all();
    self->tick();
  });
}

void WebServer::Impl::pump_all() {
  for (const auto& held : sessions_) {
    if (const auto session = held.lock()) pump(*session);
  }
}

void WebServer::Impl::append_clients(std::vector<ClientStatus>& out) const {
  for (const auto& connection : desk_->feed().connections())
    out.push_back(connection->status(desk_->now()));
}

void WebServer::Impl::stop() {
  ErrorCodeOf error;
  acceptor_.close(error);
  timer_.cancel();
  pause_.cancel();
  for (const auto& held : std::exchange(sessions_, {})) {
    if (const auto session = held.lock()) close(*session);
  }
}

WebServer::WebServer(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
WebServer::~WebServer() { impl_->stop(); }
void WebServer::publish(const std::shared_ptr<const SceneFrame>& frame) { impl_->publish(frame); }
void WebServer::append_clients(std::vector<ClientStatus>& out) const { impl_->append_clients(out); }
void WebServer::stop() { impl_->stop(); }
std::uint16_t WebServer::port() const { return impl_->port(); }

Expected<std::unique_ptr<WebServer>> start_web_server(asio::io_context& io, const WebConfig& config,
                                                      WebSources sources,
                                                      std::shared_ptr<const SceneModel> model,
                                                      const Clock& clock) {
  ErrorCodeOf error;
  const auto address = asio::ip::make_address(config.address, error);
  if (error) {
    return fail(ErrorCode::kInvalid,
                "expected an IP address like 127.0.0.1 or ::, got `" + config.address + "`",
                "streaming.web.address");
  }
  auto desk = std::make_shared<WebDesk>(config, std::move(sources), std::move(model), clock);
  if (!desk->has_page()) {
    log::warning(
        "web", "no page bundle in " + page_root(config.root).string() + ": only the API is served");
  }
  auto impl = std::make_shared<WebServer::Impl>(
      io, std::move(desk), static_cast<std::size_t>(config.max_clients) + kPlainConnections);
  if (const auto failed = impl->listen({address, config.port}))
    return tl::unexpected(bind_error(config, failed));
  impl->start();
  const std::string host = address.is_v6() ? "[" + config.address + "]" : config.address;
  log::info("web", "page at http://" + host + ":" + std::to_string(impl->port()) + "/");
  return std::make_unique<WebServer>(std::move(impl));
}

}  // namespace fiducap::web
