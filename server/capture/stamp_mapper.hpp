#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "capture/arrival_offset.hpp"

namespace fiducap {

/// Puts the stamps of one sender on the server's time line. One for all sensors that it stamps with
/// one clock, so that what lies between an image and an IMU sample stays as its sender measured it.
///
/// Synchronised clocks: the stamp is UTC. Known ones: somebody asked the other clock (TIMESYNC).
/// Otherwise by arrival, see ArrivalOffset. What is added to stamps follows what is known of the
/// clocks without steps once it has settled: time passes by 2 % too quickly or too slowly at most,
/// so the order of a sensor's stamps stays.
class StampMapper final {
 public:
  explicit StampMapper(bool synchronized) : by_arrival_(!synchronized) {}

  /// @param arrived  on the server's time line   @param utc_ns  UTC of the same instant
  /// @return nullopt: the stamp cannot be right (more than 5 s old, or from the future)
  [[nodiscard]] std::optional<Instant> place(std::int64_t stamp_ns, Instant arrived,
                                             std::int64_t utc_ns);
  /// @param known  what to add to the stamp; nullopt: not known now, by arrival
  [[nodiscard]] std::optional<Instant> place_by(std::optional<Duration> known,
                                                std::int64_t stamp_ns, Instant arrived);
  /// Stamps are of no clock that is known otherwise.
  [[nodiscard]] bool by_arrival() const { return by_arrival_; }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  /// Of the sender's clock against ours, seconds a second, by arrival; 0: not known.
  [[nodiscard]] double drift() const { return arrivals_.drift(); }

 private:
  [[nodiscard]] std::optional<Instant> judge(Instant stamp, Duration offset, Instant arrived,
                                             bool by_arrival_now);
  [[nodiscard]] Duration without_steps(Duration wanted, Instant stamp, Instant arrived);
  void start_again();

  bool by_arrival_;
  std::uint64_t refused_{0};
  int refused_in_a_row_{0};
  Duration last_refused_{};  ///< When it arrived − its stamp.
  int refused_alike_{0};     ///< In a row, with the same difference.
  ArrivalOffset arrivals_;
  std::optional<Duration> added_;  ///< To the newest stamp.
  Instant began_{};                ///< When the first message arrived.
  Instant newest_{};               ///< Stamp.
};

}  // namespace fiducap
