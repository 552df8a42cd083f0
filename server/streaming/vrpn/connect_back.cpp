#include "streaming/vrpn/connect_back.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "base/log.hpp"
#include "streaming/net/bind.hpp"
#include "streaming/vrpn/codec.hpp"

namespace fiducap::vrpn {

using boost::system::error_code;

ConnectBack::ConnectBack(boost::asio::io_context& io, udp::socket requests,
                         std::shared_ptr<SessionContext> context, Owner owner)
    : io_(io),
      requests_(std::move(requests)),
      context_(std::move(context)),
      owner_(std::move(owner)) {}

void ConnectBack::receive() {
  receiving_ = true;
  requests_.async_receive_from(
      boost::asio::buffer(request_), requester_,
      [self = shared_from_this()](const error_code& error, std::size_t size) {
        self->receiving_ = false;
        if (self->stopped_) return;
        if (error) return;  // the next tick tries again
        self->serve(size);
        self->receive();
      });
}

void ConnectBack::serve(std::size_t size) {
  const auto port = decode_request(std::span<const std::byte>(request_).first(size));
  if (!port) {
    return context_->say(log::Level::kDebug,
                         requester_.address().to_string() + " " + port.error().text());
  }
  const tcp::endpoint client(requester_.address(), *port);
  const auto same = [&](const auto& attempt) { return attempt->client == client; };
  if (std::any_of(pending_.begin(), pending_.end(), same)) return;
  const auto from_there = std::count_if(pending_.begin(), pending_.end(), [&](const auto& attempt) {
    return attempt->client.address() == client.address();
  });
  if (static_cast<int>(pending_.size()) >= kMaxPending || from_there >= kMaxPendingPerSource)
    return;
  if (owner_.wants(client)) connect(client);
}

void ConnectBack::connect(const tcp::endpoint& client) {
  const auto attempt =
      std::make_shared<Pending>(Pending{client, tcp::socket(io_), context_->clock.now()});
  pending_.push_back(attempt);
  attempt->socket.async_connect(client, [self = shared_from_this(),
                                         attempt](const error_code& error) {
    if (self->stopped_) return;
    if (std::find(self->pending_.begin(), self->pending_.end(), attempt) == self->pending_.end())
      return;
    self->done(attempt);
    if (!error) return self->owner_.connected(std::move(attempt->socket));
    self->context_->say(log::Level::kDebug,
                        net::peer_text(attempt->client) + " cannot be reached: " + error.message());
  });
}

void ConnectBack::done(const std::shared_ptr<Pending>& attempt) { std::erase(pending_, attempt); }

void ConnectBack::tick(Instant now) {
  if (!receiving_ && !stopped_) receive();
  std::erase_if(pending_, [&](const auto& attempt) {
    if (now - attempt->since <= kConnectTime) return false;
    context_->say(log::Level::kInfo,
                  net::peer_text(attempt->client) + " cannot be reached within 3 s");
    error_code ignored;
    attempt->socket.close(ignored);
    return true;
  });
}

void ConnectBack::stop() {
  stopped_ = true;
  error_code ignored;
  requests_.close(ignored);
  for (const auto& attempt : pending_) attempt->socket.close(ignored);
  pending_.clear();
}

}  // namespace fiducap::vrpn
