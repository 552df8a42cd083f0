#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "middleware/mavlink/frame.hpp"

namespace fiducap::mavlink {

/// Clock offset of the autopilot by TIMESYNC, from the quickest reply of the last seconds.
///
/// A request carries a random number in the field for the own clock, which the autopilot returns
/// unchanged. A reply therefore proves that the autopilot received the request at its address.
class ClockSync final {
 public:
  /// @return the request to send now, if one is due: ten per second at first, later one
  [[nodiscard]] std::optional<Timesync> next_request(Instant now);
  /// @return false: not a reply to a request of the last second
  bool accept_reply(const Timesync& reply, Instant now);

  struct Offset {
    Duration to_autopilot{};  ///< Its clock − ours.
    Duration bound{};         ///< Bound of the error: half the round trip.
  };
  /// @param drift  of its clock against ours, s/s; extrapolates older replies to `now`
  /// @return nullopt: no reply within the last ten seconds
  [[nodiscard]] std::optional<Offset> offset(Instant now, double drift = 0) const;

 private:
  struct Request {
    Instant at{};
    std::int64_t number{};
  };
  struct Measured {
    Instant at{};
    Offset offset;
  };
  static constexpr std::size_t kKept = 16;

  std::array<std::optional<Request>, kKept> requests_{};
  std::size_t request_count_{0};
  std::optional<Instant> next_request_at_;
  std::array<std::optional<Measured>, kKept> measured_{};
  std::size_t reply_count_{0};
};

}  // namespace fiducap::mavlink
