#include "streaming/native/control_server.hpp"

#include <string>
#include <utility>

#include "streaming/native/control_conversation.hpp"

namespace fiducap::native {

class ControlServer::Session final : public net::TcpSession {
 public:
  Session(net::Socket socket, const Clock& clock, OperatorDesk& desk, WrongProofs& wrong,
          std::uint64_t address_hash, EventNews* news)
      : TcpSession(std::move(socket), "native", clock),
        conversation_(random_challenge(), desk, wrong, address_hash, news) {
    conversation_.greet(replies(), this->clock().now());
  }

  /// Whoever knows the token keeps the place; a newcomer has time to show that he does.
  [[nodiscard]] bool may_be_replaced(Instant now) const override {
    return !conversation_.is_operator() && now - since() >= kTimeToProve;
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
    if (hanging_up_) return;
    if (!conversation_.patient(now)) return close("was silent for too long");
    conversation_.tell_events(replies(), now);
    flush();
  }

 private:
  static constexpr Duration kLastWords = std::chrono::milliseconds(200);
  static constexpr Duration kTimeToProve = std::chrono::seconds(2);

  ControlConversation conversation_;
  bool hanging_up_{false};
  Instant hang_up_at_{};
};

ControlServer::ControlServer(boost::asio::io_context& io, OperatorDesk& desk,
                             const EventBoard* events, const Clock& clock)
    : desk_(desk),
      clock_(clock),
      hash_key_(net::random_key()),
      tcp_(io, {"native", kMostClients, kMostPerAddress}, clock) {
  if (events != nullptr) news_.emplace(*events);
}

Expected<void> ControlServer::listen(const net::BindTarget& target) {
  const auto port = tcp_.listen(target, [this](net::Socket socket, const net::Peer& peer) {
    return session(std::move(socket), peer);
  });
  if (!port) return tl::unexpected(port.error());
  tcp_.start();
  return {};
}

std::shared_ptr<net::Session> ControlServer::session(net::Socket socket, const net::Peer& peer) {
  const std::uint64_t hash = net::address_hash(hash_key_, peer);
  // Who guesses learns nothing: his connection ends.
  if (wrong_.shut_out(hash, clock_.now())) return nullptr;
  return std::make_shared<Session>(std::move(socket), clock_, desk_, wrong_, hash,
                                   news_ ? &*news_ : nullptr);
}

}  // namespace fiducap::native
