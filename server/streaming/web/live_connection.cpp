#include "streaming/web/live_connection.hpp"

#include <utility>

namespace fiducap::web {

namespace {

constexpr std::size_t slot(Topic topic) { return static_cast<std::size_t>(topic); }

}  // namespace

void LiveConnection::offer(Topic topic, Message message) {
  auto& place = waiting_[slot(topic)];
  if (topic == Topic::kFrame && place) ++frames_dropped_;
  place = std::move(message);
}

void LiveConnection::offer_log(Message message, std::uint64_t last_number) {
  waiting_[slot(Topic::kLog)] = std::move(message);
  log_given_ = last_number;
}

std::optional<std::uint64_t> LiveConnection::log_wanted_after() const {
  if (waiting_[slot(Topic::kLog)]) return std::nullopt;
  return log_given_;
}

Message LiveConnection::next(Instant now) {
  if (writing_since_) return nullptr;
  for (std::size_t i = 0; i < kTopics; ++i) {
    if (!waiting_[i]) continue;
    if (i == slot(Topic::kFrame)) ++frames_sent_;
    writing_since_ = now;
    return std::exchange(waiting_[i], nullptr);
  }
  return nullptr;
}

void LiveConnection::written() { writing_since_.reset(); }

bool LiveConnection::stuck(Instant now, Duration patience) const {
  return writing_since_ && now - *writing_since_ > patience;
}

ClientStatus LiveConnection::status(Instant now) const {
  return {"web",           net::text_of(peer_) + " tcp",   "live page", frames_sent_,
          frames_dropped_, to_seconds(now - connected_at_)};
}

}  // namespace fiducap::web
