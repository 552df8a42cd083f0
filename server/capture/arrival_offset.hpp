#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "base/time.hpp"

namespace fiducap {

/// How far a sender's clock is from ours, by nothing but when its messages came: the quickest of
/// each second lie on a line whose height is the difference and whose slope is the drift. It is the
/// line below all of them that is nearest to them (the edge of their lower convex hull at their
/// middle; L. Zhang, Z. Liu, C. H. Xia, "Clock synchronization algorithms for network
/// measurements", INFOCOM 2002). Late by the quickest message's way, never by a slow one's.
/// Allocates nothing.
class ArrivalOffset final {
 public:
  /// @return what to add to the stamp
  [[nodiscard]] Duration update(Instant stamp, Instant arrived);
  void start_again() { *this = {}; }

  /// Of the sender's clock against ours, seconds a second; 0: not known yet.
  [[nodiscard]] double drift() const { return -slope_; }

 private:
  static constexpr std::size_t kKept = 16;  ///< Seconds.
  struct Quickest {
    Instant stamp{};
    Duration difference{};  ///< When it arrived − stamp.
  };

  [[nodiscard]] const Quickest& at(std::size_t k) const;
  void open_second(Instant arrived);
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

}  // namespace fiducap
