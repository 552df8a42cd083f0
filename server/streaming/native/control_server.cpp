#include "streaming/native/control_server.hpp"

#include <algorithm>
#include <random>
#include <utility>

#include "streaming/native/control_conversation.hpp"
#include "streaming/native/endpoint.hpp"
#include "streaming/native/token_mint.hpp"
#include "streaming/net/tcp_session.hpp"

namespace fiducap::native {

namespace {

std::string random_challenge() {
  std::random_device device;
  std::string challenge;
  while (challenge.size() < kChallengeSize) {
    const auto word = device();
    for (int i = 0; i < 4; ++i) challenge.push_back(static_cast<char>(word >> (8 * i)));
  }
  return challenge;
}

Peer to_peer(const boost::asio::ip::tcp::endpoint& from) {
  return native::to_peer(boost::asio::ip::udp::endpoint(from.address(), from.port()));
}

}  // namespace

class ControlServer::Session final : public net::TcpSession {
 public:
  Session(tcp::socket socket, const Clock& clock, OperatorDesk& desk, WrongProofs& wrong,
          std::uint64_t address_hash)
      : TcpSession(std::move(socket), "native", clock),
        conversation_(random_challenge(), desk, wrong, address_hash) {
    conversation_.greet(replies(), this->clock().now());
  }

 protected:
  void received(std::span<const std::byte> bytes) override {
    if (hanging_up_) return;
    hanging_up_ = !conversation_.receive(bytes, replies(), clock().now());
    flush();
    // The last words travel first; who does not hang up then is hung up on by the next tick.
    if (hanging_up_) hang_up_at_ = clock().now() + kLastWords;
  }
  void ticked(Instant now) override {
    if (hanging_up_ && now >= hang_up_at_) return close("was refused");
    if (!hanging_up_ && !conversation_.patient(now)) close("was silent for too long");
  }

 private:
  static constexpr Duration kLastWords = std::chrono::milliseconds(200);

  ControlConversation conversation_;
  bool hanging_up_{false};
  Instant hang_up_at_{};
};

ControlServer::ControlServer(OperatorDesk& desk, const Clock& clock) : desk_(desk), clock_(clock) {
  std::random_device device;
  for (auto& word : hash_key_) word = std::uint64_t{device()} << 32 | device();
}

ControlServer::~ControlServer() { stop(); }

Expected<std::unique_ptr<ControlServer>> ControlServer::open(boost::asio::io_context& io,
                                                             const net::BindTarget& target,
                                                             OperatorDesk& desk,
                                                             const Clock& clock) {
  std::unique_ptr<ControlServer> server(new ControlServer(desk, clock));
  auto listener =
      net::TcpListener::open(io, target, [raw = server.get()](boost::asio::ip::tcp::socket socket) {
        raw->accept(std::move(socket));
      });
  if (!listener) return tl::unexpected(listener.error());
  server->listener_ = std::make_unique<net::TcpListener>(std::move(*listener));
  return server;
}

void ControlServer::accept(boost::asio::ip::tcp::socket socket) {
  std::erase_if(sessions_, [](const auto& session) { return session->closed(); });
  boost::system::error_code gone;
  const auto from = socket.remote_endpoint(gone);
  if (gone) return;
  const auto same = std::count_if(sessions_.begin(), sessions_.end(), [&](const auto& session) {
    return session->endpoint().address() == from.address();
  });
  const std::uint64_t hash =
      TokenMint(hash_key_, std::chrono::hours(1)).address_hash(to_peer(from));
  // Who is one too many, or guesses, learns nothing: his connection ends.
  if (sessions_.size() >= kMostClients || static_cast<std::size_t>(same) >= kMostPerAddress ||
      wrong_.shut_out(hash, clock_.now())) {
    return;
  }
  sessions_.push_back(std::make_shared<Session>(std::move(socket), clock_, desk_, wrong_, hash));
  sessions_.back()->start();
}

void ControlServer::tick(Instant now) {
  listener_->tick();
  for (const auto& session : sessions_) session->tick(now);
  std::erase_if(sessions_, [](const auto& session) { return session->closed(); });
}

void ControlServer::stop() {
  if (listener_) listener_->stop();
  for (const auto& session : sessions_) session->close("the server ends");
  sessions_.clear();
}

}  // namespace fiducap::native
