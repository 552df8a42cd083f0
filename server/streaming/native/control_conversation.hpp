#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "streaming/native/control_codec.hpp"
#include "streaming/native/event_feed.hpp"
#include "streaming/net/limits.hpp"

namespace fiducap::native {

using net::WrongProofs;

/// kChallengeSize random bytes.
[[nodiscard]] std::string random_challenge();

/// One client's commands: bytes in → bytes out, time passed in, no socket. They come by TCP
/// (ControlServer), or in the messages of a WebSocket (`web`).
///
/// Every request carries a proof of knowing the operator's token, made for this connection and for
/// this place in it: what somebody recorded is worth nothing later. At most one message (64 KiB) is
/// kept. Who asks for events needs no token; then they are all that travels.
class ControlConversation final {
 public:
  /// @param challenge  kChallengeSize random bytes, others for each connection
  /// @param address_hash  whose wrong proofs these are
  /// @param news  nullptr: nothing can be watched
  ControlConversation(std::string challenge, OperatorDesk& desk, WrongProofs& wrong,
                      std::uint64_t address_hash, EventNews* news = nullptr);

  void greet(std::vector<std::byte>& out, Instant now);
  /// Bytes cut anywhere. @return false: say what is in `out`, then hang up
  [[nodiscard]] bool receive(std::span<const std::byte> bytes, std::vector<std::byte>& out,
                             Instant now);
  /// What a watcher has not heard yet.
  void tell_events(std::vector<std::byte>& out, Instant now);
  /// @return false for who says nothing, or does not finish what he began, for too long
  [[nodiscard]] bool patient(Instant now) const;
  /// It knows the operator's token.
  [[nodiscard]] bool is_operator() const { return sequence_ > 0; }

 private:
  [[nodiscard]] bool answer(std::span<const std::byte> message, std::vector<std::byte>& out,
                            Instant now);
  [[nodiscard]] bool watch(const ControlRequest& request, std::vector<std::byte>& out, Instant now);
  [[nodiscard]] bool is_proven(const ControlRequest& request) const;
  [[nodiscard]] ControlReply carry_out(const ControlCommand& command);

  std::string challenge_;
  OperatorDesk& desk_;
  WrongProofs& wrong_;
  std::uint64_t address_hash_;
  EventNews* news_;
  std::optional<EventFeed> feed_;  ///< Of who watches events.
  std::uint64_t sequence_{0};      ///< Of the last request.
  std::vector<std::byte> begun_;   ///< Of a message.
  Instant idle_since_{};
};

}  // namespace fiducap::native
