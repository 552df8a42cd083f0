#include "streaming/net/tcp_server.hpp"

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <string>
#include <utility>

#include "streaming/net/bind.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/net/repeated_wait.hpp"

namespace fiducap::net {

namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

constexpr auto kTick = std::chrono::milliseconds(100);

}  // namespace

/// Shared with pending handlers, which may outlive the server.
struct TcpServer::State final : RepeatedWait, std::enable_shared_from_this<State> {
  struct Listener {
    tcp::acceptor acceptor;
    MakeSession make;
    PendingWait accepting{};
  };
  struct Connecting {
    Peer peer;
    tcp::socket socket;
    Instant until;
  };

  State(asio::io_context& context, const TcpLimits& given, const Clock& time)
      : io(context), limits(given), clock(time), timer(context) {}

  void accept(const std::shared_ptr<Listener>& listener) {
    if (listener->accepting) return;
    listener->acceptor.async_accept(
        [self = shared_from_this(), listener, token = listener->accepting.begin()](
            const error_code& error, tcp::socket socket) mutable {
          token.release();
          if (self->stopped || !listener->acceptor.is_open()) return;
          if (error) return;  // e.g. out of file descriptors: the next tick tries again
          self->guard([&] { self->take_in(std::move(socket), listener->make); });
          self->guard([&] { self->accept(listener); });
        });
  }

  void take_in(tcp::socket socket, const MakeSession& make) {
    error_code gone;
    const tcp::endpoint from = socket.remote_endpoint(gone);
    sweep();
    if (gone) return;
    const auto instead_of = admit(peer_of(from));
    if (!instead_of) return;  // closes the socket
    if (const auto& spare = *instead_of)
      spare->close("is closed: all places are taken and another client needs one",
                   log::Level::kWarning);
    const auto session = make(Socket(new TcpSocket{std::move(socket)}), peer_of(from));
    if (session == nullptr) return;
    sessions.push_back(session);
    const auto whose = [&] { return "client " + text_of(session->peer()); };
    if (!log::guarded(limits.protocol, whose, [&] { session->start(); }))
      session->close("is closed after a failure", log::Level::kWarning);
  }

  void connect(const Peer& peer, Duration timeout, MakeSession make) {
    const auto there = std::ranges::count_if(
        connecting, [&](const auto& one) { return one->peer.same_address(peer); });
    const bool under_way =
        std::ranges::any_of(connecting, [&](const auto& one) { return one->peer == peer; });
    if (stopped || under_way || there >= static_cast<std::ptrdiff_t>(kMaxConnectingPerAddress) ||
        !admit(peer))
      return;
    if (connecting.size() >= kMaxConnecting) {
      // Peers that exist answer long before this: only dead addresses are given up.
      error_code ignored;
      connecting.front()->socket.close(ignored);
      connecting.erase(connecting.begin());
    }
    const auto one =
        std::make_shared<Connecting>(Connecting{peer, tcp::socket(io), clock.now() + timeout});
    connecting.push_back(one);
    one->socket.async_connect(endpoint_of(peer), [self = shared_from_this(), one,
                                                  make = std::move(make)](const error_code& error) {
      self->guard([&] { self->connected(one, error, make); });
    });
  }

  void connected(const std::shared_ptr<Connecting>& one, const error_code& error,
                 const MakeSession& make) {
    if (stopped || std::erase(connecting, one) == 0) return;
    if (!error) return take_in(std::move(one->socket), make);
    log::debug(limits.protocol, text_of(one->peer) + " tcp cannot be reached: " + error.message());
  }

  /// @return the session to be closed for this peer, nullptr if none; nullopt: there is no place
  [[nodiscard]] std::optional<std::shared_ptr<Session>> admit(const Peer& peer) {
    std::vector<Peer> all;  // a peer that is being connected to has no place yet
    for (const auto& session : sessions)
      if (!session->closed()) all.push_back(session->peer());
    const auto same =
        std::ranges::count_if(all, [&](const Peer& other) { return other.same_address(peer); });
    const bool full_here =
        limits.max_clients_per_address > 0 && same >= limits.max_clients_per_address;
    if (!full_here) {
      const Place place = place_for(peer, all, static_cast<std::size_t>(limits.max_clients));
      std::shared_ptr<Session> spare;  // the newest of the address, or the oldest replaceable one
      if (place.is_there && !place.instead_of) return spare;
      for (const auto& session : sessions) {  // in order of arrival
        if (session->closed()) continue;
        if (place.instead_of && session->peer().same_address(*place.instead_of)) spare = session;
        if (!place.instead_of && !spare && session->may_be_replaced(clock.now())) spare = session;
      }
      if (spare) return spare;
    }
    warn_full(peer, all.size(), same);
    return std::nullopt;
  }

  void warn_full(const Peer& peer, std::size_t all, std::ptrdiff_t same) {
    if (limits.section.empty() || !std::exchange(may_warn, false)) return;
    const std::string section(limits.section);
    const std::string per_address =
        limits.max_clients_per_address > 0 ? ", " + section + ".max_clients_per_address" : "";
    log::warning(limits.protocol, "no place for client " + text_of(peer) +
                                      " tcp: " + std::to_string(all) + " places are taken, " +
                                      std::to_string(same) + " by its address (" + section +
                                      ".max_clients" + per_address + ")");
  }

  void tick() {
    const Instant now = clock.now();
    may_warn = true;
    for (const auto& session : sessions) {
      const auto whose = [&] { return "client " + text_of(session->peer()); };
      if (!log::guarded(limits.protocol, whose, [&] { session->tick(now); }))
        session->close("is closed after a failure", log::Level::kWarning);
    }
    guard([&] { give_up_connecting(now); });
    if (ticked) guard([&] { ticked(now); });
    sweep();
    for (const auto& listener : listeners) guard([&] { accept(listener); });
  }

  void wait_for_tick() {
    timer.expires_after(kTick);
    timer.async_wait(
        [self = shared_from_this(), token = ticking.begin()](const error_code& error) mutable {
          token.release();
          if (error || self->stopped) return;
          self->guard([&] { self->tick(); });
          self->resume();
        });
  }

  void resume() override {
    if (started && !stopped && !ticking) wait_for_tick();
  }

  void give_up_connecting(Instant now) {
    std::erase_if(connecting, [&](const auto& one) {
      if (now <= one->until) return false;
      log::info(limits.protocol, text_of(one->peer) + " tcp cannot be reached in time");
      error_code ignored;
      one->socket.close(ignored);
      return true;
    });
  }

  void close_listeners() {
    error_code ignored;
    for (const auto& listener : listeners) listener->acceptor.close(ignored);
    listeners.clear();
  }

  void stop(Duration delay) {
    if (std::exchange(stopped, true)) return;
    close_listeners();
    error_code ignored;
    for (const auto& one : connecting) one->socket.close(ignored);
    connecting.clear();
    timer.cancel(ignored);
    if (delay == Duration{0}) return close_sessions();
    timer.expires_after(delay);
    timer.async_wait([self = shared_from_this()](const error_code&) { self->close_sessions(); });
  }

  void close_sessions() {
    for (const auto& session : sessions)
      session->close("is closed: the server stops", log::Level::kDebug);
    sessions.clear();
  }
  void sweep() {
    std::erase_if(sessions, [](const auto& session) { return session->closed(); });
  }
  template <typename Work>
  void guard(Work&& work) const {
    log::guarded(
        limits.protocol, [] { return "a connection"; }, std::forward<Work>(work));
  }

  asio::io_context& io;
  TcpLimits limits;
  const Clock& clock;
  asio::steady_timer timer;
  std::vector<std::shared_ptr<Listener>> listeners;
  std::vector<std::shared_ptr<Connecting>> connecting;
  std::vector<std::shared_ptr<Session>> sessions;
  std::function<void(Instant)> ticked;
  bool may_warn{true};  ///< Once per tick: clients cannot flood the log.
  PendingWait ticking;
  bool started{false};
  bool stopped{false};
};

TcpServer::TcpServer(asio::io_context& io, const TcpLimits& limits, const Clock& clock)
    : state_(std::make_shared<State>(io, limits, clock)) {
  register_wait(io, state_);
}

Expected<std::uint16_t> TcpServer::listen(const BindTarget& target, MakeSession make) {
  auto acceptor = listen_tcp(state_->io, target);
  if (!acceptor) return tl::unexpected(acceptor.error());
  const std::uint16_t port = acceptor->local_endpoint().port();
  state_->listeners.push_back(
      std::make_shared<State::Listener>(State::Listener{std::move(*acceptor), std::move(make)}));
  state_->accept(state_->listeners.back());
  return port;
}

void TcpServer::close_listeners() { state_->close_listeners(); }
void TcpServer::connect(const Peer& peer, Duration timeout, MakeSession make) {
  state_->connect(peer, timeout, std::move(make));
}
void TcpServer::start(std::function<void(Instant)> ticked) {
  state_->ticked = std::move(ticked);
  state_->started = true;
  state_->resume();
}
void TcpServer::stop(Duration delay) { state_->stop(delay); }
const std::vector<std::shared_ptr<Session>>& TcpServer::sessions() const {
  return state_->sessions;
}
const TcpLimits& TcpServer::limits() const { return state_->limits; }

}  // namespace fiducap::net
