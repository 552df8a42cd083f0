#pragma once

#include <array>
#include <cstdint>

#include "src/clock_filter.hpp"
#include "src/messages.hpp"

namespace fiducap::sdk {

/// Schedules requests for the server's time and evaluates the replies. No socket, no clock.
class ClockSync {
 public:
  /// @param first_number  random, so that replies cannot be forged blindly
  explicit ClockSync(std::uint64_t first_number) : next_number_(first_number) {}

  /// Restarts for a new connection: requests at once, in quick succession at first.
  void start(Nanoseconds now);
  Nanoseconds due_at() const { return due_at_; }
  /// @return the number of the request to send now
  std::uint64_t ask(Nanoseconds now);
  void on(const ClockReply& reply, Nanoseconds now);

  /// @param same_machine  the clocks are the same, unless replies contradict (time namespaces)
  ClockEstimate at(Nanoseconds now, bool same_machine) const;

 private:
  struct Question {
    std::uint64_t number{};
    Nanoseconds asked{-1};  ///< -1: replied to, or free.
  };
  std::array<Question, 32> questions_{};
  std::uint64_t next_number_;
  int asked_{0};
  Nanoseconds due_at_{0};
  ClockFilter filter_;
};

}  // namespace fiducap::sdk
