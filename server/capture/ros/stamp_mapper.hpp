#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace fiducap::dds {

/// Puts the stamps of one host's messages on the server's time line. One for all sensors of a body,
/// so that what lies between an image and an IMU sample stays as its sender measured it.
///
/// Synchronised clocks: the stamp is UTC. Otherwise the smallest difference between arrival and
/// stamp of the last 10 to 20 s is taken for the difference of the clocks: late by the quickest
/// message's way, never by a slow one's.
class StampMapper final {
 public:
  explicit StampMapper(bool synchronized) : by_arrival_(!synchronized) {}

  /// @param arrived  on the server's time line   @param utc_ns  UTC of the same instant
  /// @return nullopt: the stamp cannot be right (more than 5 s old, or from the future)
  [[nodiscard]] std::optional<Instant> place(std::int64_t stamp_ns, Instant arrived,
                                             std::int64_t utc_ns);

  [[nodiscard]] bool by_arrival() const { return by_arrival_; }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  [[nodiscard]] Duration offset_by_arrival(std::int64_t stamp_ns, Instant arrived);
  void start_again();

  bool by_arrival_;
  std::uint64_t refused_{0};
  int refused_in_a_row_{0};
  std::optional<Instant> window_began_;
  std::optional<Duration> smallest_;         ///< arrival − stamp, of this window
  std::optional<Duration> smallest_before_;  ///< of the one before
};

}  // namespace fiducap::dds
