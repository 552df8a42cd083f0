#include "streaming/qualisys/server.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "base/log.hpp"

namespace fiducap::qualisys {

namespace {

using boost::system::error_code;

constexpr auto kTick = std::chrono::milliseconds(100);
constexpr auto kGoodbye = std::chrono::milliseconds(50);
constexpr std::string_view kKey = "streaming.qualisys";
constexpr int kBindAttempts = 32;  // for port 0: three in a row must be free
constexpr std::uint16_t kLastFreeBase = 65'533;

}  // namespace

Server::Server(boost::asio::io_context& io, const QualisysConfig& config, OperatorDesk* desk,
               const Clock& clock)
    : io_(io), clock_(clock), room_(std::make_shared<Room>(config, desk)), timer_(io) {}

Expected<void> Server::listen(const SceneModel& model) {
  const QualisysConfig& config = room_->config;
  auto udp = net::bind_udp(io_, {config.address, 0, kKey, "address"});
  if (!udp) return tl::unexpected(udp.error());
  udp_.emplace(std::move(*udp));
  Expected<void> opened = open_doors(config.base_port);
  for (int i = 1; i < kBindAttempts && !opened && config.base_port == 0; ++i)
    opened = open_doors(0);
  if (!opened) return opened;
  room_->bodies.update(model);
  open_discovery();
  tick();
  return {};
}

Expected<void> Server::open_doors(std::uint16_t base_port) {
  doors_.clear();
  auto first = open_door(Door::kLegacy, base_port);
  if (!first) return tl::unexpected(first.error());
  base_port = first->port();
  if (base_port > kLastFreeBase) return fail(ErrorCode::kUnavailable, "no three free ports");
  doors_.push_back(std::move(*first));
  for (const Door door : {Door::kLittleEndian, Door::kBigEndian}) {
    const auto offset = door == Door::kLittleEndian ? kLittleEndianOffset : kBigEndianOffset;
    auto next = open_door(door, static_cast<std::uint16_t>(base_port + offset));
    if (!next) return tl::unexpected(next.error());
    doors_.push_back(std::move(*next));
  }
  base_port_ = base_port;
  return {};
}

Expected<net::TcpListener> Server::open_door(Door door, std::uint16_t port) {
  const std::weak_ptr<Server> weak = weak_from_this();
  return net::TcpListener::open(io_, {room_->config.address, port, kKey, "base_port"},
                                [weak, door](tcp::socket socket) {
                                  if (const auto self = weak.lock()) {
                                    self->accepted(std::move(socket), door);
                                  }
                                });
}

void Server::open_discovery() {
  if (room_->config.discovery_port == 0) return;
  auto discovery = Discovery::open(io_, room_->config, base_port_, clock_);
  if (discovery) {
    discovery_ = std::move(*discovery);
  } else {  // clients that are told the address work without
    log::warning("qualisys", "discovery is not answered: " + discovery.error().text());
  }
}

void Server::accepted(tcp::socket socket, Door door) {
  error_code error;
  const auto peer = socket.remote_endpoint(error);
  if (stopped_ || error || !peer.address().is_v4() || !has_room_for(peer)) return;  // closes it
  sweep();
  sessions_.push_back(
      std::make_shared<Session>(std::move(socket), room_, door, next_client_++, clock_));
  sessions_.back()->greet();
}

bool Server::has_room_for(const tcp::endpoint& client) {
  const auto open = [](const auto& session) { return !session->closed(); };
  const auto all = std::count_if(sessions_.begin(), sessions_.end(), open);
  const auto from_there = std::count_if(sessions_.begin(), sessions_.end(), [&](const auto& s) {
    return open(s) && s->endpoint().address() == client.address();
  });
  const QualisysConfig& config = room_->config;
  if (all < config.max_clients && from_there < config.max_clients_per_address) return true;
  if (!std::exchange(may_complain_, false)) return false;
  log::warning("qualisys", "no room for client " + net::peer_text(client) + ": " +
                               std::to_string(all) + " places are taken, " +
                               std::to_string(from_there) + " by its address (" +
                               std::string(kKey) + ".max_clients, .max_clients_per_address)");
  return false;
}

void Server::publish(const std::shared_ptr<const SceneFrame>& frame) {
  if (stopped_) return;
  room_->rate_hz = frame->rate_hz;
  if (frame->model != nullptr && room_->bodies.update(*frame->model)) {
    tell_all(Event::kCameraSettingsChanged);
  }
  room_->frames.put(frame, room_->bodies);
  batch_.clear();
  for (const auto& session : sessions_) {
    if (session->closed()) continue;
    session->answer_current();
    send_frame(*session, *frame);
  }
  send_datagrams();
}

void Server::send_frame(Session& session, const SceneFrame& frame) {
  session.datagrams.clear();
  const auto profile = session.connection().stream_of(frame);
  if (!profile) return;
  const auto encoded = room_->frames.encoded(*profile);
  if (!session.connection().udp_port()) {
    return session.offer(net::SharedBytes(encoded, &encoded->packet));
  }
  const sockaddr_in& target = session.udp_target();
  session.datagrams.open(batch_);
  std::size_t begin = 0;
  for (const std::size_t end : encoded->datagram_ends) {
    batch_.add(encoded->datagrams().subspan(begin, end - begin),
               reinterpret_cast<const sockaddr*>(&target), sizeof(target));
    begin = end;
  }
  session.datagrams.close(batch_);
  if (encoded->datagram_ends.empty()) session.datagrams.drop();  // too long for any datagram
}

void Server::send_datagrams() {
  if (batch_.size() == 0) return;
  batch_.send(udp_->native_handle());
  for (const auto& session : sessions_) session->datagrams.settle(batch_);
}

void Server::tell_all(Event event) {
  for (const auto& session : sessions_) {
    if (!session->closed()) session->tell(event);
  }
}

void Server::append_clients(std::vector<ClientStatus>& out) const {
  const Instant now = clock_.now();
  for (const auto& session : sessions_) {
    if (!session->closed()) out.push_back(session->status(now));
  }
}

void Server::tick() {
  const Instant now = clock_.now();
  for (const auto& session : sessions_) session->tick(now);
  sweep();
  events_.clear();
  room_->control.observe(events_);
  for (const Event event : events_) tell_all(event);
  for (auto& door : doors_) door.tick();
  if (discovery_) discovery_->tick();
  may_complain_ = true;
  timer_.expires_after(kTick);
  timer_.async_wait([self = shared_from_this()](const error_code& error) {
    if (!error && !self->stopped_) self->tick();
  });
}

void Server::sweep() {
  std::erase_if(sessions_, [](const auto& session) {
    if (session->closed()) session->connection().leave();
    return session->closed();
  });
}

void Server::stop() {
  if (stopped_) return;
  stopped_ = true;
  for (auto& door : doors_) door.stop();
  if (discovery_) discovery_->stop();
  tell_all(Event::kShuttingDown);
  timer_.expires_after(kGoodbye);  // clients whose socket is full may still hear it
  timer_.async_wait([self = shared_from_this()](const error_code&) { self->close_all(); });
}

void Server::close_all() {
  for (const auto& session : sessions_) {
    session->close("is left: the server stops", log::Level::kDebug);
  }
  sessions_.clear();
}

std::uint16_t Server::discovery_port() const { return discovery_ ? discovery_->port() : 0; }

}  // namespace fiducap::qualisys
