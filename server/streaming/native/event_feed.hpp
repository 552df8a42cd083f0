#pragma once

#include <cstdint>
#include <optional>

#include "base/event_board.hpp"
#include "base/time.hpp"
#include "streaming/native/control_codec.hpp"

namespace fiducap::native {

/// What one watcher has been told of the events, and what it is to be told next.
class EventFeed final {
 public:
  /// So often it hears something, that it knows the connection to be alive.
  static constexpr Duration kHeartbeat = std::chrono::seconds(5);

  /// @param after  newest event that the watcher knows
  EventFeed(const EventBoard& board, std::uint64_t after, std::uint64_t sequence)
      : board_(board), after_(after), sequence_(sequence) {
    if (const auto all = board_.after(0); all.empty() || all.back().number < after) after_ = 0;
  }

  /// @return nullopt: nothing new, and it has heard from us a moment ago
  [[nodiscard]] std::optional<ControlReply> next(Instant now) {
    const std::uint64_t revision = board_.revision();
    if (told_at_ && revision == revision_ && now - *told_at_ < kHeartbeat) return std::nullopt;
    revision_ = revision;
    told_at_ = now;
    ControlReply reply;
    reply.sequence = sequence_;
    reply.events = ControlEvents{board_.after(after_), board_.standing()};
    if (!reply.events->happened.empty()) after_ = reply.events->happened.back().number;
    return reply;
  }

 private:
  const EventBoard& board_;
  std::uint64_t after_;
  std::uint64_t sequence_;
  std::uint64_t revision_{0};
  std::optional<Instant> told_at_;
};

}  // namespace fiducap::native
