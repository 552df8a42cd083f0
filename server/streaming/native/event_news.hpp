#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/event_board.hpp"
#include "streaming/native/control_codec.hpp"

namespace fiducap::native {

/// The board for all who watch it: what they are told is encoded once, however many they are. Lives
/// on the I/O thread, which does not wait for who writes on the board.
class EventNews final {
 public:
  /// @param board  outlives this
  explicit EventNews(const EventBoard& board) : board_(board), sheet_(board.sheet()) {}

  /// Newer with each call, if there is news.
  [[nodiscard]] const EventSheet& newest() {
    board_.refresh(sheet_);
    return *sheet_;
  }
  /// What happened after `after` and what stands, as of the last `newest`; until the next call.
  [[nodiscard]] const std::string& encoded(std::uint64_t after) {
    if (encoded_of_ == sheet_ && encoded_after_ == after) return encoded_;
    encoded_ = encode_events(sheet_->after(after), sheet_->standing);
    encoded_of_ = sheet_;
    encoded_after_ = after;
    ++encodings_;
    return encoded_;
  }
  /// How often something was encoded.
  [[nodiscard]] std::uint64_t encodings() const { return encodings_; }

 private:
  const EventBoard& board_;
  std::shared_ptr<const EventSheet> sheet_;
  std::shared_ptr<const EventSheet> encoded_of_;
  std::uint64_t encoded_after_{0};
  std::string encoded_;
  std::uint64_t encodings_{0};
};

}  // namespace fiducap::native
