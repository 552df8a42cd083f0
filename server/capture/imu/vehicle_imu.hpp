#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/imu/byte_link.hpp"
#include "capture/imu/link_config.hpp"
#include "capture/imu/mavlink_vehicle.hpp"
#include "capture/imu_sample.hpp"
#include "capture/stamp_mapper.hpp"
#include "middleware/mavlink/clock_sync.hpp"

namespace fiducap::mavlink {

/// The conversation with an autopilot: readings in; heartbeats, clock questions, requests out.
///
/// Stamps are placed by the quickest round trip of TIMESYNC; by arrival if none came or fits.
///
/// An answer to TIMESYNC proves the sender's address. A vehicle without proof is replaced by one
/// with proof, so a forged sender keeps the real autopilot out for one round trip at most.
class VehicleImu final {
 public:
  explicit VehicleImu(const MavlinkImuConfig& config);

  struct Counts {
    std::uint64_t readings{0};
    std::uint64_t repeated{0};       ///< Marked as not updated.
    std::uint64_t other_message{0};  ///< Of another message than the one that is taken.
  };

  /// Bytes of one sender, any piece of its stream.
  void receive(std::span<const std::byte> bytes, const net::Peer& from, Instant arrived);
  /// The oldest one not taken yet, in axes x forward, y left, z up.
  [[nodiscard]] std::optional<ImuSample> take() { return waiting_.take(); }

  /// Appends messages that are due, for `address`.
  void append_due(Instant now, std::vector<std::byte>& out);
  /// Address of the vehicle; nullopt: none, or silent for too long.
  [[nodiscard]] std::optional<net::Peer> address(Instant now) const;

  /// Its address is proven by an answer to TIMESYNC within the last ten seconds.
  [[nodiscard]] bool is_proven(Instant now) const { return sync_.offset(now).has_value(); }
  /// Appends a TIMESYNC question to a rival of an unproven vehicle, once for each piece received.
  /// @return its receiver, if there is one
  [[nodiscard]] std::optional<net::Peer> challenge(Instant now, std::vector<std::byte>& out);

  /// Shown to the user, once.
  struct Event {
    std::string text;
    bool is_bad{true};
  };
  [[nodiscard]] std::optional<Event> take_event() {
    if (events_.empty()) return std::nullopt;
    Event first = std::move(events_.front());
    events_.erase(events_.begin());
    return first;
  }

  [[nodiscard]] const Counts& counts() const { return counts_; }
  [[nodiscard]] const FrameStream& frames() const { return stream_; }
  [[nodiscard]] const VehicleChoice& choice() const { return choice_; }
  [[nodiscard]] double measured_hz() const { return requests_.measured_hz(); }
  [[nodiscard]] std::optional<ClockSync::Offset> clock_offset(Instant now) const {
    return sync_.offset(now);
  }

 private:
  void take_frame(const Frame& frame, const net::Peer& from, Instant arrived);
  void take_foreign(const Frame& frame, const net::Peer& from, Instant arrived);
  [[nodiscard]] std::int64_t number_for(const net::Peer& rival, std::int64_t slot) const;
  void take_reading(const Frame& frame, Instant arrived);
  [[nodiscard]] std::optional<Instant> place(const InertialReading& reading, Instant arrived);
  [[nodiscard]] int rank_of(MessageId message) const;
  void restart();
  void report(std::string text, bool is_bad = true) {
    events_.push_back({std::move(text), is_bad});
  }
  /// This computer is a component of the vehicle.
  [[nodiscard]] Sender next_sender() {
    const auto& vehicle = choice_.vehicle();
    const int system = vehicle ? vehicle->system : config_.system > 0 ? config_.system : 1;
    return {static_cast<std::uint8_t>(system), kOnboardComputer, sequence_++};
  }

  MavlinkImuConfig config_;
  FrameStream stream_;
  net::Peer last_from_{};
  VehicleChoice choice_;
  int changes_{0};
  std::array<std::uint64_t, 2> key_;
  std::optional<net::Peer> rival_;         ///< To be asked for a proof.
  std::optional<net::Peer> proven_rival_;  ///< Has given one.
  RateRequests requests_;
  ClockSync sync_;
  DeviceClock microseconds_{64, 1000};
  DeviceClock milliseconds_{32, 1'000'000};
  std::uint64_t restarts_{0};
  std::optional<MessageId> taken_;  ///< The message that readings are taken from …
  Instant taken_at_{};              ///< … and its last arrival.
  std::optional<Instant> last_sampled_;
  ImuQueue waiting_;
  std::vector<std::byte> answers_;
  std::optional<Instant> next_heartbeat_;
  std::uint8_t sequence_{0};
  bool foreign_clock_reported_{false};
  std::vector<Event> events_;
  Counts counts_;
};

}  // namespace fiducap::mavlink
