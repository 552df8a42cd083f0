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
constexpr int kBindAttempts = 16;  // for port 0: the number that TCP got may be taken for UDP
constexpr std::string_view kKey = "streaming.vrpn";

}  // namespace

Server::Server(boost::asio::io_context& io, const VrpnConfig& config, const Clock& clock)
    : io_(io),
      context_(std::make_shared<SessionContext>(SessionContext{config, clock})),
      timer_(io),
      encoder_(config.axes(), {config.velocity, config.acceleration}) {
  context_->log_lines_left = kLogLinesPerSecond;
}

Expected<void> Server::listen(const SceneModel& model) {
  Expected<void> bound = bind(context_->config.port);
  for (int i = 1; i < kBindAttempts && !bound && context_->config.port == 0; ++i) bound = bind(0);
  if (!bound) return bound;
  take_over(model);
  requests_->start();
  tick();
  return {};
}

Expected<void> Server::bind(std::uint16_t port) {
  const std::string& address = context_->config.address;
  const std::weak_ptr<Server> weak = weak_from_this();
  auto listener = net::TcpListener::open(io_, {address, port, kKey}, [weak](tcp::socket socket) {
    if (const auto self = weak.lock()) self->begin(std::move(socket), Origin::kDirect);
  });
  if (!listener) return tl::unexpected(listener.error());
  auto requests = net::bind_udp(io_, {address, listener->port(), kKey});
  if (!requests) return tl::unexpected(requests.error());
  auto reports = net::bind_udp(io_, {address, 0, kKey});
  if (!reports) return tl::unexpected(reports.error());
  port_ = listener->port();
  listener_.emplace(std::move(*listener));
  reports_.emplace(std::move(*reports));
  requests_ = std::make_shared<ConnectBack>(
      io_, std::move(*requests), context_,
      ConnectBack::Owner{[weak](const tcp::endpoint& client) {
                           const auto self = weak.lock();
                           return self != nullptr && self->wants(client);
                         },
                         [weak](tcp::socket socket) {
                           if (const auto self = weak.lock())
                             self->begin(std::move(socket), Origin::kRequested);
                         }});
  return {};
}

bool Server::wants(const tcp::endpoint& client) const {
  const bool served = std::any_of(sessions_.begin(), sessions_.end(), [&](const auto& session) {
    return !session->closed() && session->origin() == Origin::kRequested &&
           session->endpoint() == client;
  });
  return !served && has_room_for(client);
}

bool Server::has_room_for(const tcp::endpoint& client) const {
  const auto open =
      std::count_if(sessions_.begin(), sessions_.end(), [](const auto& s) { return !s->closed(); });
  const auto used = open + static_cast<std::ptrdiff_t>(requests_->pending());
  if (used < context_->config.max_clients) return true;
  context_->say(log::Level::kWarning, "no room for client " + net::peer_text(client) + ": all " +
                                          std::to_string(used) +
                                          " places are taken (streaming.vrpn.max_clients)");
  return false;
}

void Server::begin(tcp::socket socket, Origin origin) {
  error_code error;
  const auto peer = socket.remote_endpoint(error);
  if (stopped_ || error || !has_room_for(peer)) return;  // closes it
  sweep();
  sessions_.push_back(std::make_shared<Session>(context_, std::move(socket), origin));
  sessions_.back()->greet();
}

void Server::tick() {
  const Instant now = context_->clock.now();
  for (const auto& session : sessions_) session->tick(now);
  sweep();
  if (++ticks_ % kTicksPerSecond == 0) {
    context_->log_lines_left = kLogLinesPerSecond;
    if (const int lost = std::exchange(context_->log_lines_lost, 0); lost > 0) {
      context_->say(log::Level::kInfo,
                    std::to_string(lost) + " more lines within a second were left out");
    }
  }
  listener_->tick();
  requests_->tick(now);
  timer_.expires_after(kTick);
  timer_.async_wait([self = shared_from_this()](const error_code& error) {
    if (!error && !self->stopped_) self->tick();
  });
}

void Server::take_over(const SceneModel& model) {
  if (generation_ == model.generation) return;
  generation_ = model.generation;
  sensors_of_body_.clear();
  if (!context_->config.sensors.empty()) {
    for (const auto& body : model.bodies)
      sensors_of_body_.push_back(context_->config.sensors_of(body.name));
  }
  for (const auto& name : context_->senders.update(model)) {
    context_->say(
        log::Level::kError,
        "the body \"" + name + "\" is not served: its name is doubled or breaks VRPN's rules");
  }
}

void Server::say_changes(const SceneFrame& frame) {
  if (frame.model != nullptr) {
    const std::size_t known = context_->senders.names().size();
    take_over(*frame.model);
    if (context_->senders.names().size() > known) {
      for (const auto& session : sessions_) session->describe_new_senders();
    }
  }
  texts_.clear();
  watch_.observe(frame, context_->senders.of_bodies(), texts_);
  if (texts_.empty()) return;
  number_messages(texts_, context_->sequence);
  for (const auto& session : sessions_) {
    if (session->open()) session->send_reliable(texts_);
  }
}

void Server::publish(const std::shared_ptr<const SceneFrame>& newest) {
  if (stopped_) return;
  const SceneFrame& frame = *newest;
  context_->utc_offset = frame.utc_offset;
  say_changes(frame);
  if (std::none_of(sessions_.begin(), sessions_.end(), [](const auto& s) { return s->open(); }))
    return;
  const auto reports = frames_.acquire();
  encoder_.encode(frame, context_->senders.of_bodies(), sensors_of_body_, *reports);
  if (reports->bytes.empty()) return;
  number_messages(reports->bytes, context_->sequence);
  batch_.clear();
  for (const auto& session : sessions_) send_frame(*session, reports);
  send_datagrams();
}

void Server::send_frame(Session& session, const std::shared_ptr<const EncodedFrame>& reports) {
  session.datagrams.clear();
  if (!session.open()) return;
  if (!session.by_udp()) return session.offer(net::SharedBytes(reports, &reports->bytes));
  const sockaddr_in& target = session.udp_target();
  const auto* address = reinterpret_cast<const sockaddr*>(&target);
  session.datagrams.open(batch_);
  if (const std::size_t cut = reports->equal_cut(); cut > 0) {
    batch_.add_cut(reports->bytes, cut, address, sizeof(target));
  } else {
    std::size_t begin = 0;
    for (const std::size_t end : reports->datagram_ends) {
      batch_.add(std::span(reports->bytes).subspan(begin, end - begin), address, sizeof(target));
      begin = end;
    }
  }
  session.datagrams.close(batch_);
}

void Server::send_datagrams() {
  if (batch_.size() == 0) return;
  batch_.send(reports_->native_handle());
  for (const auto& session : sessions_) session->datagrams.settle(batch_);
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
  if (listener_) listener_->stop();
  if (requests_) requests_->stop();
  timer_.cancel();
  for (const auto& session : sessions_)
    session->close("is left: the server stops", log::Level::kDebug);
  sessions_.clear();
}

void Server::sweep() {
  std::erase_if(sessions_, [](const auto& session) { return session->closed(); });
}

}  // namespace fiducap::vrpn
