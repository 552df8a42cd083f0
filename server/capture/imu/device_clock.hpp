#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "capture/stamp_mapper.hpp"

namespace fiducap {

/// The clock of one device, a counter that may wrap and that starts again when the device does, on
/// the server's time line. What it gives strictly increases; a reading that does not is dropped.
class DeviceClock final {
 public:
  /// @param bits  of the counter, 2 … 64   @param tick_ns  what it counts
  DeviceClock(int bits, std::int64_t tick_ns) : bits_(bits), tick_ns_(tick_ns) {}

  /// @param known  what to add to the device's time, if somebody asked its clock
  /// @return nullopt: not later than the reading before, or of no time that can be right
  [[nodiscard]] std::optional<Instant> place(std::uint64_t count, Instant arrived,
                                             std::optional<Duration> known = std::nullopt);

  /// Of something else that the device stamped; nullopt: no reading has come yet.
  [[nodiscard]] std::optional<Instant> time_of(std::uint64_t count) const;

  [[nodiscard]] std::uint64_t restarts() const { return restarts_; }
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  /// Known offsets were refused: they are of another clock.
  [[nodiscard]] bool by_arrival() const { return mapper_.by_arrival(); }
  [[nodiscard]] double drift() const { return mapper_.drift(); }

 private:
  [[nodiscard]] std::int64_t unwrapped(std::uint64_t count) const;
  void start_again();

  int bits_;
  std::int64_t tick_ns_;
  StampMapper mapper_{true};
  std::optional<std::uint64_t> last_count_;  ///< As it came, of the newest reading …
  std::int64_t last_ns_{0};                  ///< … and without wraps.
  std::optional<Instant> last_placed_;
  int backwards_in_a_row_{0};
  std::uint64_t restarts_{0};
  std::uint64_t dropped_{0};
};

}  // namespace fiducap
