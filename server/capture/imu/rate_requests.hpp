#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "capture/imu/mavlink_config.hpp"
#include "capture/imu/mavlink_messages.hpp"

namespace fiducap::mavlink {

/// Asks a vehicle for inertial readings at the wanted rate, until it sends them: by
/// SET_MESSAGE_INTERVAL, then in the way of older ArduPilots. Once a second at first, every ten
/// seconds when that did not help, which is said once.
class RateRequests final {
 public:
  explicit RateRequests(const MavlinkImuConfig& config)
      : message_(config.message), wanted_hz_(config.rate_hz) {}

  /// A reading came.
  void count(Instant now);
  /// Another vehicle, or it has started again.
  void begin_anew();
  /// @param taken  the message that readings come in now, if any
  void append_due(const Target& vehicle, std::uint8_t autopilot, std::optional<MessageId> taken,
                  Instant now, Sender& from, std::vector<std::byte>& out);

  [[nodiscard]] double measured_hz() const { return measured_hz_; }
  [[nodiscard]] std::optional<std::string> take_news() {
    return std::exchange(news_, std::nullopt);
  }

 private:
  [[nodiscard]] std::vector<MessageId> candidates(std::uint8_t autopilot,
                                                  std::optional<MessageId> taken) const;
  void measure(Instant now);

  MavlinkImuMessage message_;
  double wanted_hz_;
  std::optional<Instant> window_began_;
  int in_window_{0};
  double measured_hz_{0};
  std::optional<Instant> next_;
  int asked_{0};
  bool told_{false};
  std::optional<std::string> news_;
};

}  // namespace fiducap::mavlink
