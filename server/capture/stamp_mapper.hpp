#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace fiducap {

/// Offset and drift of a sender's clock against ours, from the arrival times of its messages alone.
///
/// The quickest messages of each second lie on a line: its height is the offset, its slope the
/// drift. The line below all of them that is nearest to them is the edge of their lower convex hull
/// at their middle (L. Zhang, Z. Liu, C. H. Xia, "Clock synchronization algorithms for network
/// measurements", INFOCOM 2002). The error is the delay of the quickest message. Allocates nothing.
class ArrivalOffset final {
 public:
  /// @return what to add to the stamp
  [[nodiscard]] Duration update(Instant stamp, Instant arrived);
  void start_again() { *this = {}; }

  /// Of the sender's clock against ours, seconds per second; 0: not known yet.
  [[nodiscard]] double drift() const { return -slope_; }

 private:
  static constexpr std::size_t kKept = 16;  ///< Seconds.
  struct Quickest {
    Instant stamp{};
    Duration difference{};  ///< Arrival time − stamp.
  };

  /// @param k  0: the oldest
  [[nodiscard]] const Quickest& at(std::size_t k) const {
    return quickest_[(next_ + kKept - count_ + k) % kKept];
  }
  void fit();
  [[nodiscard]] double slope_below() const;
  [[nodiscard]] Duration on_line(Instant stamp) const;

  std::array<Quickest, kKept> quickest_{};  ///< A ring, the newest is the present second.
  std::size_t next_{0};
  std::size_t count_{0};
  std::optional<Instant> second_began_;
  Instant origin_{};  ///< Of the line, a stamp.
  Duration height_{};
  double slope_{0};
};

/// Maps the stamps of one clock to the server's time line. One mapper serves all its sensors.
///
/// The offset is that of UTC (synchronised clocks), measured by the caller (TIMESYNC), or estimated
/// from arrival times (ArrivalOffset). It changes without steps once it has settled: by 2 % of the
/// time passed at most, so the order of a sensor's stamps is preserved.
class StampMapper final {
 public:
  explicit StampMapper(bool synchronized) : by_arrival_(!synchronized) {}

  /// @param arrived  on the server's time line   @param utc_ns  UTC of the same instant
  /// @return nullopt: the stamp is more than 5 s old, or in the future
  [[nodiscard]] std::optional<Instant> place(std::int64_t stamp_ns, Instant arrived,
                                             std::int64_t utc_ns);
  /// @param known  what to add to the stamp; nullopt: not known now, by arrival
  [[nodiscard]] std::optional<Instant> place_by(std::optional<Duration> known,
                                                std::int64_t stamp_ns, Instant arrived);
  /// Stamps are placed by arrival: from the start, or because UTC or known offsets did not fit.
  [[nodiscard]] bool by_arrival() const { return by_arrival_; }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  [[nodiscard]] double drift() const { return arrivals_.drift(); }  ///< Seconds per second.

 private:
  [[nodiscard]] std::optional<Instant> check(Instant stamp, Duration offset, Instant arrived,
                                             bool by_arrival_now);
  [[nodiscard]] Duration without_steps(Duration wanted, Instant stamp, Instant arrived);
  void start_again() {
    refused_in_a_row_ = refused_equally_ = 0;
    arrivals_.start_again();
    added_.reset();
  }

  bool by_arrival_;
  std::uint64_t refused_{0};
  int refused_in_a_row_{0};
  Duration last_refused_{};  ///< Arrival time − stamp.
  int refused_equally_{0};   ///< In a row, with the same difference.
  ArrivalOffset arrivals_;
  std::optional<Duration> added_;  ///< To the newest stamp.
  Instant began_{};                ///< Arrival of the first message.
  Instant newest_{};               ///< Stamp.
};

/// Maps a device's counter, which may wrap and restart, to our clock. Drops what does not increase.
class DeviceClock final {
 public:
  /// @param bits  of the counter, 2 … 64   @param tick_ns  unit of the counter
  DeviceClock(int bits, std::int64_t tick_ns) : bits_(bits), tick_ns_(tick_ns) {}

  /// @param known  what to add to the device's time, if it was measured
  /// @return nullopt: not later than the reading before, or refused by StampMapper
  [[nodiscard]] std::optional<Instant> place(std::uint64_t count, Instant arrived,
                                             std::optional<Duration> known = std::nullopt);

  /// Time of another event that the device stamped; nullopt: no reading has come yet.
  [[nodiscard]] std::optional<Instant> time_of(std::uint64_t count) const;

  [[nodiscard]] std::uint64_t restarts() const { return restarts_; }
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  /// Known offsets were refused: they belong to another clock.
  [[nodiscard]] bool by_arrival() const { return mapper_.by_arrival(); }
  [[nodiscard]] double drift() const { return mapper_.drift(); }

 private:
  [[nodiscard]] std::int64_t unwrapped(std::uint64_t count) const;

  int bits_;
  std::int64_t tick_ns_;
  StampMapper mapper_{true};
  std::optional<std::uint64_t> last_count_;  ///< Of the newest reading, as received …
  std::int64_t last_ns_{0};                  ///< … and without wraps.
  std::optional<Instant> last_placed_;
  int backwards_in_a_row_{0};
  std::uint64_t restarts_{0};
  std::uint64_t dropped_{0};
};

}  // namespace fiducap
