#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/imu/byte_link.hpp"
#include "capture/imu/device_clock.hpp"
#include "capture/imu/mavlink_config.hpp"
#include "capture/imu/mavlink_messages.hpp"
#include "capture/imu/rate_requests.hpp"
#include "capture/imu/vehicle_choice.hpp"
#include "capture/imu_sample.hpp"
#include "middleware/mavlink/clock_sync.hpp"

namespace fiducap::mavlink {

/// The conversation with the autopilot whose IMU is taken, without the socket: readings in, in our
/// axes and on our clock; heartbeats, clock questions and requests out.
///
/// Stamps are the autopilot's, placed by the quickest round trip of TIMESYNC; by arrival as long as
/// it does not answer, or when its stamps are of another clock.
///
/// An answer to TIMESYNC proves the sender's address. A vehicle that has not given one keeps its
/// place until another one has: the others are asked meanwhile, so that a forged sender keeps the
/// real autopilot out for no longer than a round trip.
class VehicleImu final {
 public:
  explicit VehicleImu(const MavlinkImuConfig& config);

  struct Counts {
    std::uint64_t readings{0};
    std::uint64_t repeated{0};       ///< Told as not read anew.
    std::uint64_t other_message{0};  ///< Of another message than the one that is taken.
  };

  /// Bytes of one sender, any piece of its stream.
  void receive(std::span<const std::byte> bytes, const LinkPeer& from, Instant arrived);
  /// The oldest one not taken yet, in axes x forward, y left, z up.
  [[nodiscard]] std::optional<ImuSample> take();

  /// Appends what is due; it goes to `address`.
  void speak(Instant now, std::vector<std::byte>& out);
  /// Where the vehicle speaks from; nullopt: it has not been heard, or not for long.
  [[nodiscard]] std::optional<LinkPeer> address(Instant now) const;

  /// Is that address proven? By an answer to TIMESYNC within the last ten seconds.
  [[nodiscard]] bool is_proven(Instant now) const { return sync_.offset(now).has_value(); }
  /// Appends a question to one who wants the place of a vehicle that is not proven; once for each
  /// piece received. @return whom it goes to, if there is one
  [[nodiscard]] std::optional<LinkPeer> challenge(Instant now, std::vector<std::byte>& out);

  /// Something a person should know, in words; once.
  struct News {
    std::string text;
    bool is_bad{true};
  };
  [[nodiscard]] std::optional<News> take_news();

  [[nodiscard]] const Counts& counts() const { return counts_; }
  [[nodiscard]] const FrameStream& frames() const { return stream_; }
  [[nodiscard]] const VehicleChoice& choice() const { return choice_; }
  [[nodiscard]] double measured_hz() const { return requests_.measured_hz(); }
  [[nodiscard]] std::optional<ClockSync::Offset> clock_offset(Instant now) const {
    return sync_.offset(now);
  }

 private:
  void take_frame(const Frame& frame, const LinkPeer& from, Instant arrived);
  void take_foreign(const Frame& frame, const LinkPeer& from, Instant arrived);
  [[nodiscard]] std::int64_t number_for(const LinkPeer& rival, std::int64_t slot) const;
  void take_timesync(const Frame& frame, Instant arrived);
  void take_reading(const Frame& frame, Instant arrived);
  [[nodiscard]] int rank_of(MessageId message) const;
  [[nodiscard]] bool is_taken(MessageId message, Instant arrived);
  void begin_anew();
  void tell(const std::string& text, bool is_bad = true);
  [[nodiscard]] Sender next_sender();

  MavlinkImuConfig config_;
  FrameStream stream_;
  LinkPeer last_from_{};
  VehicleChoice choice_;
  int turn_{0};
  std::array<std::uint64_t, 2> key_;
  std::optional<LinkPeer> rival_;         ///< To be asked for a proof.
  std::optional<LinkPeer> proven_rival_;  ///< Has given one.
  RateRequests requests_;
  ClockSync sync_;
  DeviceClock microseconds_{64, 1000};
  DeviceClock milliseconds_{32, 1'000'000};
  std::uint64_t restarts_{0};
  std::optional<MessageId> taken_;  ///< The message that readings are taken from …
  Instant taken_at_{};              ///< … and when it came last.
  std::optional<Instant> last_sampled_;
  std::vector<ImuSample> waiting_;
  std::size_t given_{0};
  std::vector<std::byte> answers_;
  std::optional<Instant> next_heartbeat_;
  std::uint8_t sequence_{0};
  bool told_foreign_clock_{false};
  std::vector<News> news_;
  Counts counts_;
};

}  // namespace fiducap::mavlink
