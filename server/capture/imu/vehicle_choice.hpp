#pragma once

#include <bitset>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "base/time.hpp"
#include "capture/imu/byte_link.hpp"
#include "middleware/mavlink/frame.hpp"

namespace fiducap::mavlink {

/// Which of the vehicles that speak on one link is ours: the configured one, else the first one,
/// until it has been silent for ten seconds or another one has the better proof. The others are
/// counted and named once.
class VehicleChoice final {
 public:
  /// @param system  0: the first one
  explicit VehicleChoice(int system) : wanted_(system) {}

  struct Vehicle {
    std::uint8_t system{};
    std::uint8_t component{};
    std::uint8_t autopilot{};  ///< MAV_AUTOPILOT; 0: generic, or no heartbeat yet.
    LinkPeer at{};
    Instant heard_at{};
  };

  /// @param may_replace  the sender takes the place though it is held
  /// @return whether the frame is of our vehicle's autopilot
  bool hear(const Frame& frame, const LinkPeer& from, Instant now, bool may_replace = false);
  /// Would its sender be ours if the place were free?
  [[nodiscard]] bool is_candidate(const Frame& frame) const;

  [[nodiscard]] const std::optional<Vehicle>& vehicle() const { return vehicle_; }
  /// Counts up when another vehicle is taken.
  [[nodiscard]] int turn() const { return turn_; }
  [[nodiscard]] std::uint64_t foreign() const { return foreign_; }  ///< Frames of other vehicles.
  /// Another vehicle than the one that is taken speaks here, in words; once for each.
  [[nodiscard]] std::optional<std::string> take_news() {
    return std::exchange(news_, std::nullopt);
  }
  [[nodiscard]] std::string text_of_vehicle() const;

 private:
  void choose(const Frame& frame, const LinkPeer& from, Instant now);
  void note_foreign(const Frame& frame, const LinkPeer& from);

  int wanted_;
  std::optional<Vehicle> vehicle_;
  int turn_{0};
  std::uint64_t foreign_{0};
  std::bitset<256> named_;
  std::optional<std::string> news_;
};

/// `PX4`, `ArduPilot`, `autopilot`
[[nodiscard]] std::string_view name_of_autopilot(std::uint8_t autopilot);

}  // namespace fiducap::mavlink
