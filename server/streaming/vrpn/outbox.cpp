#include "streaming/vrpn/outbox.hpp"

#include <span>
#include <utility>

#include "streaming/vrpn/codec.hpp"

namespace fiducap::vrpn {

bool Outbox::offer(std::shared_ptr<const EncodedFrame> frame) {
  const bool nothing_lost = frame_ == nullptr;
  frame_ = std::move(frame);
  return nothing_lost;
}

bool Outbox::take(Instant now, std::vector<std::byte>& out) {
  note_waiting(now);
  if (writing_ || (greeting_.empty() && reliable_.empty() && frame_ == nullptr)) return false;
  out.assign(greeting_.begin(), greeting_.end());
  out.insert(out.end(), reliable_.begin(), reliable_.end());
  if (frame_ != nullptr) out.insert(out.end(), frame_->bytes.begin(), frame_->bytes.end());
  number_messages(std::span(out).subspan(greeting_.size()), next_sequence_);
  reliable_in_flight_ = greeting_.size() + reliable_.size();
  in_flight_since_ = std::exchange(waiting_since_, std::nullopt);
  greeting_.clear();
  reliable_.clear();
  frame_.reset();
  writing_ = true;
  return true;
}

void Outbox::written(Instant now) {
  writing_ = false;
  reliable_in_flight_ = 0;
  in_flight_since_.reset();
  note_waiting(now);
}

std::optional<std::string> Outbox::overdue(Instant now) {
  note_waiting(now);
  const std::size_t bytes = reliable_in_flight_ + greeting_.size() + reliable_.size();
  if (bytes > kMaxReliableBytes) return "does not read: " + std::to_string(bytes) + " bytes wait for it";
  const auto oldest = in_flight_since_ ? in_flight_since_ : waiting_since_;
  if (oldest && now - *oldest > kMaxWait) return "does not read: a message waits for more than 2 s";
  return std::nullopt;
}

void Outbox::note_waiting(Instant now) {
  if (!waiting_since_ && !(greeting_.empty() && reliable_.empty())) waiting_since_ = now;
}

}  // namespace fiducap::vrpn
