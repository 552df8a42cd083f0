#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::web {

/// One encoded message, shared by all pages that get it.
using Message = std::shared_ptr<const std::string>;

/// The kinds of messages, in the order in which waiting ones leave.
enum class Topic : std::size_t { kHello, kEvents, kMap, kFits, kFrame, kClients, kLog };
inline constexpr std::size_t kTopics = 7;

/// One live page's conversation, without its socket: one waiting message per topic, the newest
/// wins, so a page that reads slowly costs seven messages and no more. Only frames count as
/// dropped; log lines wait until there is room.
class LiveConnection final {
 public:
  LiveConnection(const net::Peer& peer, Instant connected_at)
      : peer_(peer), connected_at_(connected_at) {}
  [[nodiscard]] const net::Peer& peer() const { return peer_; }

  /// Leaves `message` for the page; a waiting one of the same topic is forgotten.
  void offer(Topic topic, Message message);
  /// Leaves log lines up to `last_number`. @pre log_wanted_after()
  void offer_log(Message message, std::uint64_t last_number);
  /// @return the number after which lines are wanted; nullopt while older lines still wait.
  [[nodiscard]] std::optional<std::uint64_t> log_wanted_after() const;

  /// The next message to write, nullptr when there is none or one is still under way.
  [[nodiscard]] Message next(Instant now);
  /// The message given by `next` has left.
  void written();
  /// Somebody else gets its place: it is closed with the next look.
  void dismiss() { dismissed_ = true; }
  [[nodiscard]] bool dismissed() const { return dismissed_; }
  /// True when a write is under way for longer than `patience`: the other side has stopped reading.
  [[nodiscard]] bool stuck(Instant now, Duration patience) const;

  [[nodiscard]] ClientStatus status(Instant now) const;

 private:
  net::Peer peer_;
  Instant connected_at_;
  std::array<Message, kTopics> waiting_{};
  std::optional<Instant> writing_since_;
  bool dismissed_{false};
  std::uint64_t log_given_{0};
  std::uint64_t frames_sent_{0};
  std::uint64_t frames_dropped_{0};
};

}  // namespace fiducap::web
