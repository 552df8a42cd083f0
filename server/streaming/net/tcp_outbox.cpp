#include "streaming/net/tcp_outbox.hpp"

#include <utility>

namespace fiducap::net {

bool TcpOutbox::offer(SharedBytes frame) {
  const bool nothing_lost = frame_ == nullptr;
  frame_ = std::move(frame);
  return nothing_lost;
}

std::optional<TcpOutbox::Pieces> TcpOutbox::take(Instant now) {
  note_waiting(now);
  if (writing_ || (replies_.empty() && frame_ == nullptr)) return std::nullopt;
  writing_ = true;
  in_flight_since_ = std::exchange(waiting_since_, std::nullopt).value_or(now);
  replies_in_flight_.swap(replies_);
  replies_.clear();
  frame_in_flight_ = std::exchange(frame_, nullptr);
  Pieces pieces{};
  pieces[0] = replies_in_flight_;
  if (frame_in_flight_) pieces[1] = *frame_in_flight_;
  return pieces;
}

void TcpOutbox::written(Instant now) {
  writing_ = false;
  in_flight_since_.reset();
  replies_in_flight_.clear();
  frame_in_flight_.reset();
  note_waiting(now);
}

std::optional<std::string> TcpOutbox::overdue(Instant now) {
  note_waiting(now);
  const std::size_t bytes = replies_in_flight_.size() + replies_.size();
  if (bytes > kMaxReplyBytes)
    return "does not read: " + std::to_string(bytes) + " bytes of replies wait for it";
  const auto oldest = in_flight_since_ ? in_flight_since_ : waiting_since_;
  if (oldest && now - *oldest > kMaxWait) return "does not read: a message waits for more than 5 s";
  return std::nullopt;
}

void TcpOutbox::note_waiting(Instant now) {
  if (!waiting_since_ && !replies_.empty()) waiting_since_ = now;
}

}  // namespace fiducap::net
