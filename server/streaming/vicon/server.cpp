#include "streaming/vicon/server.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "base/log.hpp"

namespace fiducap::vicon {

namespace {

constexpr auto kTick = std::chrono::milliseconds(100);

}  // namespace

Server::Server(boost::asio::io_context& io, const ViconConfig& config, const Clock& clock)
    : io_(io),
      config_(config),
      context_(std::make_shared<SessionContext>(
          SessionContext{clock, FrameBoard(config.when_invalid, config.aliases)})),
      timer_(io) {}

Expected<void> Server::listen() {
  auto listener = net::TcpListener::open(io_, {config_.address, config_.port, "streaming.vicon"},
                                         [weak = weak_from_this()](tcp::socket socket) {
                                           if (const auto self = weak.lock())
                                             self->accepted(std::move(socket));
                                         });
  if (!listener) return tl::unexpected(listener.error());
  listener_.emplace(std::move(*listener));
  port_ = listener_->port();
  tick();
  return {};
}

void Server::accepted(tcp::socket socket) {
  boost::system::error_code gone;
  const auto peer = socket.remote_endpoint(gone);
  sweep();
  if (stopped_ || gone || !has_room_for(peer)) return;  // closes it
  sessions_.push_back(std::make_shared<Session>(std::move(socket), io_, context_));
  sessions_.back()->begin();
}

bool Server::has_room_for(const tcp::endpoint& client) {
  const auto from_here = std::count_if(
      sessions_.begin(), sessions_.end(),
      [&](const auto& session) { return session->endpoint().address() == client.address(); });
  const bool room = sessions_.size() < static_cast<std::size_t>(config_.max_clients);
  if (room && from_here < config_.max_clients_per_address) return true;
  if (std::exchange(may_complain_, false)) {
    log::warning(
        "vicon",
        "no room for client " + net::peer_text(client) + ": " +
            (room ? std::to_string(from_here) + " from its address (max_clients_per_address)"
                  : "all " + std::to_string(sessions_.size()) + " places are taken (max_clients)") +
            " of streaming.vicon");
  }
  return false;
}

void Server::tick() {
  const Instant now = context_->clock.now();
  for (const auto& session : sessions_) session->tick(now);
  sweep();
  listener_->tick();
  may_complain_ = true;
  timer_.expires_after(kTick);
  timer_.async_wait([self = shared_from_this()](const boost::system::error_code& error) {
    if (!error && !self->stopped_) self->tick();
  });
}

void Server::publish(const std::shared_ptr<const SceneFrame>& frame) {
  if (stopped_ || frame->model == nullptr) return;
  context_->board.put_up(*frame, context_->clock.now());
  for (const auto& session : sessions_) session->publish();
}

void Server::append_clients(std::vector<ClientStatus>& out) const {
  const Instant now = context_->clock.now();
  for (const auto& session : sessions_) {
    if (!session->closed() && session->open()) out.push_back(session->status(now));
  }
}

void Server::stop() {
  if (stopped_) return;
  stopped_ = true;
  if (listener_) listener_->stop();
  timer_.cancel();
  for (const auto& session : sessions_) session->end("is left: the server stops");
  sessions_.clear();
}

void Server::sweep() {
  std::erase_if(sessions_, [](const auto& session) { return session->closed(); });
}

}  // namespace fiducap::vicon
