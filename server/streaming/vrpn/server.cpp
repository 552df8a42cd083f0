#include "streaming/vrpn/server.hpp"

#include <algorithm>
#include <chrono>
#include <span>
#include <string>
#include <utility>

#include "base/log.hpp"
#include "streaming/vrpn/codec.hpp"

namespace fiducap::vrpn {

namespace {

using boost::system::error_code;

constexpr auto kTick = std::chrono::milliseconds(100);
constexpr int kTicksPerSecond = 10;
constexpr int kLogLinesPerSecond = 20;
constexpr int kBacklog = 64;
constexpr int kBindAttempts = 16;  // for port 0: the number that TCP got may be taken for UDP
constexpr int kMaxPending = 32;
constexpr int kMaxPendingPerSource = 16;

std::string remedy(const error_code& error, const std::string& address, std::uint16_t port) {
  namespace errc = boost::system::errc;
  const std::string number = std::to_string(port);
  if (error == errc::address_in_use) {
    return "port " + number + " is in use, perhaps by another mocap server; end it (`ss -tulpn | grep " + number +
           "` shows it) or set streaming.vrpn.port to a free one";
  }
  if (error == errc::permission_denied) {
    return "port " + number + " may be used by root only; set streaming.vrpn.port to 1024 or above (usual: 3883)";
  }
  if (error == errc::address_not_available) {
    return "this machine has no interface with the address " + address +
           "; set streaming.vrpn.address to one of its addresses (`ip -4 addr` lists them) or to 0.0.0.0 for all";
  }
  return "cannot use port " + number + ": " + error.message();
}

}  // namespace

Server::Server(boost::asio::io_context& io, const VrpnConfig& config, const Clock& clock)
    : io_(io),
      context_(std::make_shared<SessionContext>(SessionContext{config, clock})),
      acceptor_(io),
      requests_(io),
      timer_(io),
      encoder_(config.axes(), {config.velocity, config.acceleration}) {
  context_->log_lines_left = kLogLinesPerSecond;
}

Expected<void> Server::listen(const SceneModel& model) {
  Expected<void> bound = bind(context_->config.port);
  for (int i = 1; i < kBindAttempts && !bound && context_->config.port == 0; ++i) bound = bind(0);
  if (!bound) return bound;
  take_over(model);
  accept();
  receive_request();
  tick();
  return {};
}

Expected<void> Server::bind(std::uint16_t port) {
  const std::string& text = context_->config.address;
  error_code error;
  const auto address = boost::asio::ip::make_address_v4(text, error);
  if (error) return fail(ErrorCode::kInvalid, "expected an IPv4 address, came \"" + text + "\"", "streaming.vrpn.address");
  const auto refuse = [&](const char* transport) {
    acceptor_.close();
    requests_.close();
    return fail(ErrorCode::kUnavailable, remedy(error, text, port), "VRPN on " + text + ", " + transport);
  };
  acceptor_.open(tcp::v4(), error);
  // So that a restart need not wait for connections that were closed a moment ago.
  if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor_.bind({address, port}, error);
  if (!error) acceptor_.listen(kBacklog, error);
  if (error) return refuse("TCP");
  port = acceptor_.local_endpoint().port();
  requests_.open(udp::v4(), error);
  if (!error) requests_.bind({address, port}, error);
  if (error) return refuse("UDP");
  port_ = port;
  return {};
}

void Server::accept() {
  accepting_ = true;
  acceptor_.async_accept([self = shared_from_this()](const error_code& error, tcp::socket socket) {
    self->accepting_ = false;
    if (self->stopped_) return;
    if (error) return;  // e.g. out of file descriptors: the next tick tries again
    self->accepted(std::move(socket));
    self->accept();
  });
}

void Server::accepted(tcp::socket socket) {
  error_code error;
  const auto peer = socket.remote_endpoint(error);
  if (error || !has_room_for(peer)) return;  // closes it
  begin(std::make_shared<Session>(context_, std::move(socket), peer, Origin::kDirect));
}

void Server::receive_request() {
  receiving_ = true;
  requests_.async_receive_from(boost::asio::buffer(request_), requester_,
                               [self = shared_from_this()](const error_code& error, std::size_t size) {
                                 self->receiving_ = false;
                                 if (self->stopped_) return;
                                 if (error) return;  // the next tick tries again
                                 self->serve_request(size);
                                 self->receive_request();
                               });
}

void Server::serve_request(std::size_t size) {
  const auto port = decode_request(std::span<const std::byte>(request_).first(size));
  if (!port) {
    return context_->say(log::Level::kDebug, requester_.address().to_string() + " " + port.error().text());
  }
  // The datagram's own source, whatever address its text names: nobody can make us connect to a third party.
  const tcp::endpoint client(requester_.address(), *port);
  const bool served = std::any_of(sessions_.begin(), sessions_.end(), [&](const auto& session) {
    return !session->closed() && session->origin() == Origin::kRequested && session->peer() == client;
  });
  if (served) return;  // clients repeat themselves; a second connection would never be accepted
  const auto pending = [&](auto&& which) {
    return std::count_if(sessions_.begin(), sessions_.end(),
                         [&](const auto& session) { return session->connecting() && which(*session); });
  };
  const auto from_here = [&](const Session& s) { return s.peer().address() == client.address(); };
  if (pending([](const Session&) { return true; }) >= kMaxPending || pending(from_here) >= kMaxPendingPerSource) return;
  if (!has_room_for(client)) return;
  begin(std::make_shared<Session>(context_, tcp::socket(io_), client, Origin::kRequested));
}

bool Server::has_room_for(const tcp::endpoint& client) const {
  const auto used = std::count_if(sessions_.begin(), sessions_.end(), [](const auto& s) { return !s->closed(); });
  if (used < context_->config.max_clients) return true;
  context_->say(log::Level::kWarning, "no room for client " + client.address().to_string() + ":" +
                                          std::to_string(client.port()) + ": all " + std::to_string(used) +
                                          " places are taken (streaming.vrpn.max_clients)");
  return false;
}

void Server::begin(const std::shared_ptr<Session>& session) {
  sweep();
  sessions_.push_back(session);
  session->start();
}

void Server::tick() {
  const Instant now = context_->clock.now();
  for (const auto& session : sessions_) session->tick(now);
  sweep();
  if (++ticks_ % kTicksPerSecond == 0) {
    context_->log_lines_left = kLogLinesPerSecond;
    if (const int lost = std::exchange(context_->log_lines_lost, 0); lost > 0) {
      context_->say(log::Level::kInfo, std::to_string(lost) + " more lines within a second were left out");
    }
  }
  if (!accepting_) accept();
  if (!receiving_) receive_request();
  timer_.expires_after(kTick);
  timer_.async_wait([self = shared_from_this()](const error_code& error) {
    if (!error && !self->stopped_) self->tick();
  });
}

void Server::take_over(const SceneModel& model) {
  for (const auto& name : context_->senders.update(model)) {
    context_->say(log::Level::kError, "the body \"" + name + "\" is not served: its name is doubled or breaks VRPN's rules");
  }
}

void Server::publish(const SceneFrame& frame) {
  if (stopped_) return;
  context_->utc_offset = frame.utc_offset;
  if (frame.model != nullptr) {
    const std::size_t known = context_->senders.names().size();
    take_over(*frame.model);
    if (context_->senders.names().size() > known) {
      for (const auto& session : sessions_) session->describe_new_senders();
    }
  }
  const auto senders = context_->senders.of_bodies();
  texts_.clear();
  watch_.observe(frame, senders, texts_);
  if (!texts_.empty()) {
    for (const auto& session : sessions_) session->send_reliable(texts_);
  }
  if (std::none_of(sessions_.begin(), sessions_.end(), [](const auto& s) { return s->open(); })) return;
  const auto reports = frames_.acquire();
  encoder_.encode(frame, senders, *reports);
  if (reports->bytes.empty()) return;
  numbered_ = reports->bytes;
  for (const auto& session : sessions_) session->publish(reports, numbered_);
}

void Server::append_clients(std::vector<ClientStatus>& out) const {
  const Instant now = context_->clock.now();
  for (const auto& session : sessions_) {
    if (session->open()) out.push_back(session->status(now));
  }
}

void Server::stop() {
  if (stopped_) return;
  stopped_ = true;
  error_code ignored;
  acceptor_.close(ignored);
  requests_.close(ignored);
  timer_.cancel();
  for (const auto& session : sessions_) session->close("is left: the server stops");
  sessions_.clear();
}

void Server::sweep() {
  std::erase_if(sessions_, [](const auto& session) { return session->closed(); });
}

}  // namespace fiducap::vrpn
