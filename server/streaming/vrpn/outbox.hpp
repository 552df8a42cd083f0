#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "streaming/vrpn/report_encoder.hpp"

namespace fiducap::vrpn {

/// What waits to be written to one client's TCP socket. Bounded: of reports only the newest frame waits, an older one is
/// dropped whole; descriptions, pongs and texts all wait, and when they wait too long the client must go.
class Outbox final {
 public:
  static constexpr std::size_t kMaxReliableBytes = 1 << 20;
  static constexpr Duration kMaxWait = std::chrono::seconds(2);

  /// Sent before everything else, without a sequence number.
  void greet(const std::vector<std::byte>& cookie) { greeting_ = cookie; }
  /// Encoders append whole messages here.
  [[nodiscard]] std::vector<std::byte>& reliable() { return reliable_; }
  /// @return false when an older frame was dropped for this one.
  bool offer(std::shared_ptr<const EncodedFrame> frame);

  /// Moves all that waits into `out` (overwritten) for one write, the sequence counted on.
  /// @return false when nothing waits or the last write is not done.
  bool take(Instant now, std::vector<std::byte>& out);
  /// The last write is complete.
  void written(Instant now);
  /// @return why this client must be closed.
  [[nodiscard]] std::optional<std::string> overdue(Instant now);

 private:
  void note_waiting(Instant now);

  std::vector<std::byte> greeting_;
  std::vector<std::byte> reliable_;
  std::shared_ptr<const EncodedFrame> frame_;
  std::uint32_t next_sequence_{0};
  bool writing_{false};
  std::size_t reliable_in_flight_{0};
  std::optional<Instant> in_flight_since_;  ///< Of reliable data only.
  std::optional<Instant> waiting_since_;
};

}  // namespace fiducap::vrpn
