#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "middleware/mavlink/messages.hpp"

namespace fiducap::mavlink {

/// How far the autopilot's clock is from ours, by TIMESYNC: question and answer, of the last
/// answers the one that was quickest. Often at first, once a second later.
///
/// A question carries a random number where others write their clock, which the autopilot gives
/// back as it is: whoever answers has read the question, so the address that it went to is its own.
class ClockSync final {
 public:
  /// @return the question to send now, if one is due
  [[nodiscard]] std::optional<Timesync> question(Instant now);
  /// @return false: not an answer to a question of ours of the last seconds
  bool answer(const Timesync& answer, Instant now);

  struct Offset {
    Duration to_autopilot{};  ///< Its clock − ours.
    Duration doubt{};         ///< Half the round trip: the truth is not further away.
  };
  /// @param drift  of its clock against ours, seconds a second, by which an older answer is carried
  /// on
  /// @return nullopt: no answer within the last ten seconds
  [[nodiscard]] std::optional<Offset> offset(Instant now, double drift = 0) const;

 private:
  struct Question {
    Instant at{};
    std::int64_t number{};
  };
  struct Measured {
    Instant at{};
    Offset offset;
  };
  static constexpr std::size_t kKept = 16;

  std::array<std::optional<Question>, kKept> asked_{};
  std::size_t next_asked_{0};
  std::optional<Instant> next_question_;
  std::array<std::optional<Measured>, kKept> measured_{};
  std::size_t answers_{0};
};

}  // namespace fiducap::mavlink
