#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "streaming/native/event_news.hpp"

namespace fiducap::native {

/// What one watcher has been told of the events, and what it is to be told next.
class EventFeed final {
 public:
  /// So often it hears something, that it knows the connection to be alive.
  static constexpr Duration kHeartbeat = std::chrono::seconds(5);

  /// @param after  newest event that the watcher knows
  EventFeed(EventNews& news, std::uint64_t after, std::uint64_t sequence)
      : news_(news), after_(after), sequence_(sequence) {
    const auto& kept = news_.newest().happened;
    if (kept.empty() || kept.back()->number < after) after_ = 0;
  }

  /// Appends what is new, or nothing if it has heard from us a moment ago.
  void tell(std::vector<std::byte>& out, Instant now) {
    const EventSheet& sheet = news_.newest();
    if (told_at_ && sheet.revision == revision_ && now - *told_at_ < kHeartbeat) return;
    append(out, sequence_, news_.encoded(after_));
    revision_ = sheet.revision;
    told_at_ = now;
    if (!sheet.happened.empty()) after_ = sheet.happened.back()->number;
  }

 private:
  EventNews& news_;
  std::uint64_t after_;
  std::uint64_t sequence_;
  std::uint64_t revision_{0};
  std::optional<Instant> told_at_;
};

}  // namespace fiducap::native
