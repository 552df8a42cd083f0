#include "streaming/net/tcp_listener.hpp"

#include <utility>

namespace fiducap::net {

using boost::asio::ip::tcp;
using boost::system::error_code;

/// Shared with the one pending accept, which may outlive the listener in the I/O queue.
struct TcpListener::State : std::enable_shared_from_this<State> {
  State(tcp::acceptor opened, Accepted handler)
      : acceptor(std::move(opened)),
        port(acceptor.local_endpoint().port()),
        accepted(std::move(handler)) {}

  void accept() {
    accepting = true;
    acceptor.async_accept([self = shared_from_this()](const error_code& error, tcp::socket socket) {
      self->accepting = false;
      if (self->stopped || error)
        return;  // e.g. out of file descriptors: the next tick tries again
      self->accepted(std::move(socket));
      if (!self->stopped) self->accept();
    });
  }

  tcp::acceptor acceptor;
  std::uint16_t port;
  Accepted accepted;
  bool accepting{false};
  bool stopped{false};
};

Expected<TcpListener> TcpListener::open(boost::asio::io_context& io, const BindTarget& target,
                                        Accepted accepted) {
  auto acceptor = listen_tcp(io, target);
  if (!acceptor) return tl::unexpected(acceptor.error());
  auto state = std::make_shared<State>(std::move(*acceptor), std::move(accepted));
  state->accept();
  return TcpListener(std::move(state));
}

TcpListener::~TcpListener() {
  if (state_) stop();
}

void TcpListener::tick() {
  if (!state_->accepting && !state_->stopped) state_->accept();
}

void TcpListener::stop() {
  state_->stopped = true;
  error_code ignored;
  state_->acceptor.close(ignored);
}

std::uint16_t TcpListener::port() const { return state_->port; }

}  // namespace fiducap::net
