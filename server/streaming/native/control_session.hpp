#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "streaming/native/control_codec.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/net/tcp_server.hpp"
#include "streaming/operator_api.hpp"

namespace fiducap::native {

/// The event board for all watching clients: events are encoded once. Lives on the I/O thread,
/// which does not wait for writers of the board.
class SharedEvents final {
 public:
  /// @param board  outlives this
  explicit SharedEvents(const EventBoard& board) : board_(board), snapshot_(board.snapshot()) {}

  /// The current events.
  [[nodiscard]] const EventSnapshot& newest() {
    board_.refresh(snapshot_);
    return *snapshot_;
  }
  /// Events after `after` and current conditions, as of `newest`; valid until the next call.
  [[nodiscard]] const std::string& encoded(std::uint64_t after) {
    if (encoded_of_ == snapshot_ && encoded_after_ == after) return encoded_;
    encoded_ = encode_events(snapshot_->after(after), snapshot_->standing);
    encoded_of_ = snapshot_;
    encoded_after_ = after;
    ++encodings_;
    return encoded_;
  }
  /// Count, for tests.
  [[nodiscard]] std::uint64_t encodings() const { return encodings_; }

 private:
  const EventBoard& board_;
  std::shared_ptr<const EventSnapshot> snapshot_;
  std::shared_ptr<const EventSnapshot> encoded_of_;
  std::uint64_t encoded_after_{0};
  std::string encoded_;
  std::uint64_t encodings_{0};
};

/// The events sent to one watching client.
class EventFeed final {
 public:
  /// Period of messages without new events, to show that the connection is alive.
  static constexpr Duration kHeartbeat = std::chrono::seconds(5);

  /// @param after  newest event that the client knows
  EventFeed(SharedEvents& events, std::uint64_t after, std::uint64_t sequence)
      : events_(events), after_(after), sequence_(sequence) {
    const auto& kept = events_.newest().happened;
    if (kept.empty() || kept.back()->number < after) after_ = 0;
  }

  /// Appends new events; nothing when there are none and the last message is recent.
  void append_new(std::vector<std::byte>& out, Instant now) {
    const EventSnapshot& snapshot = events_.newest();
    if (sent_at_ && snapshot.revision == revision_ && now - *sent_at_ < kHeartbeat) return;
    append(out, sequence_, events_.encoded(after_));
    revision_ = snapshot.revision;
    sent_at_ = now;
    if (!snapshot.happened.empty()) after_ = snapshot.happened.back()->number;
  }

 private:
  SharedEvents& events_;
  std::uint64_t after_;
  std::uint64_t sequence_;
  std::uint64_t revision_{0};
  std::optional<Instant> sent_at_;
};

using net::WrongProofs;

/// kChallengeSize random bytes.
[[nodiscard]] std::string random_challenge();

/// The other end of a ControlConversation.
struct ControlClient {
  std::uint64_t address_hash{};  ///< For wrong proofs.
  Requester by{};
  bool reads_only{false};  ///< May prove the token for reading instead; has no commands.
  SharedEvents* events{};  ///< nullptr: no events.
};

/// One client's commands: bytes in → bytes out, time passed in, no socket. They come by TCP
/// (ControlServer) or in the messages of a WebSocket (`web`).
///
/// Every request carries a proof of the operator's token, valid for this connection and sequence
/// number only: it cannot be replayed. At most one message (64 KiB) is buffered. A request for
/// events needs no token; then only events are sent.
class ControlConversation final {
 public:
  /// @param challenge  kChallengeSize random bytes, others for each connection
  ControlConversation(std::string challenge, OperatorApi& operator_api, WrongProofs& wrong,
                      ControlClient client);

  void greet(std::vector<std::byte>& out, Instant now);
  /// Bytes cut anywhere. @return false: send `out`, then disconnect
  [[nodiscard]] bool receive(std::span<const std::byte> bytes, std::vector<std::byte>& out,
                             Instant now);
  /// For a watching client: the new events.
  void append_events(std::vector<std::byte>& out, Instant now);
  /// @return false: no request, or no end of one, for too long
  [[nodiscard]] bool is_alive(Instant now) const;
  /// The client has proven a token that is still valid.
  [[nodiscard]] bool is_admitted() const {
    return sequence_ > 0 && proven_at_ == operator_api_.tokens_changed();
  }

 private:
  [[nodiscard]] bool answer(std::span<const std::byte> message, std::vector<std::byte>& out,
                            Instant now);
  [[nodiscard]] bool watch(const ControlRequest& request, std::vector<std::byte>& out, Instant now);
  [[nodiscard]] bool is_proven(const ControlRequest& request) const;
  [[nodiscard]] ControlReply carry_out(const ControlAction& action);

  std::string challenge_;
  OperatorApi& operator_api_;
  WrongProofs& wrong_;
  ControlClient client_;
  std::optional<EventFeed> feed_;  ///< Of a watching client.
  std::uint64_t sequence_{0};      ///< Of the last request.
  std::uint64_t proven_at_{0};     ///< tokens_changed() then.
  std::vector<std::byte> begun_;   ///< Incomplete message.
  Instant idle_since_{};
};

/// The control channel: commands with the operator's token, events for all clients.
class ControlServer final {
 public:
  static constexpr int kMostClients = 32;
  static constexpr int kMostPerAddress = 8;

  /// @param events  nullptr: no events
  ControlServer(boost::asio::io_context& io, OperatorApi& operator_api, const EventBoard* events,
                const Clock& clock);
  /// @return Error with the remedy when the port cannot be bound
  [[nodiscard]] Expected<void> listen(const net::BindTarget& target);
  void stop() { tcp_.stop(); }

 private:
  class Session;
  [[nodiscard]] std::shared_ptr<net::Session> session(net::Socket socket, const net::Peer& peer);

  OperatorApi& operator_api_;
  std::optional<SharedEvents> events_;
  const Clock& clock_;
  std::array<std::uint64_t, 2> hash_key_;
  net::WrongProofs wrong_;
  net::TcpServer tcp_;
};

}  // namespace fiducap::native
