#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/time.hpp"

namespace fiducap::net {

/// The bytes of one encoded frame, shared by all its readers.
using SharedBytes = std::shared_ptr<const std::vector<std::byte>>;

/// What waits to be written to one client's TCP socket, without the socket.
///
/// Bounded: of frames only the newest waits, an older one is dropped whole; replies all wait, and
/// when they wait too long or grow too big the client must go.
class TcpOutbox final {
 public:
  static constexpr std::size_t kMaxReplyBytes = 1 << 20;
  static constexpr Duration kMaxWait = std::chrono::seconds(5);

  /// Appended whole, in order, before any waiting frame.
  void reply(std::span<const std::byte> bytes) {
    replies_.insert(replies_.end(), bytes.begin(), bytes.end());
  }
  /// Encoders may append whole messages here themselves.
  [[nodiscard]] std::vector<std::byte>& replies() { return replies_; }
  /// @return false when an older frame was dropped for this one
  bool offer(SharedBytes frame);
  /// The next offer drops a frame.
  [[nodiscard]] bool frame_waits() const { return frame_ != nullptr; }

  /// Pieces of one write, in this order; they stay where they are until `written`.
  using Pieces = std::array<std::span<const std::byte>, 2>;
  /// @return nullopt when nothing waits or the last write is not done
  [[nodiscard]] std::optional<Pieces> take(Instant now);
  /// The last write is complete.
  void written(Instant now);
  /// @return why this client must be closed
  [[nodiscard]] std::optional<std::string> overdue(Instant now);

 private:
  void note_waiting(Instant now);

  std::vector<std::byte> replies_;
  SharedBytes frame_;
  std::vector<std::byte> replies_in_flight_;
  SharedBytes frame_in_flight_;
  bool writing_{false};
  std::optional<Instant> in_flight_since_;
  std::optional<Instant> waiting_since_;  ///< Of replies.
};

}  // namespace fiducap::net
