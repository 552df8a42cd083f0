#pragma once

#include <array>
#include <cstdint>

#include "src/clock_filter.hpp"
#include "src/messages.hpp"

namespace fiducap::sdk {

/// When to ask the server for the time, and what its answers say. No socket; time is passed in.
class ClockSync {
 public:
  /// @param first_number  random, so that nobody can answer blindly
  explicit ClockSync(std::uint64_t first_number) : next_number_(first_number) {}

  /// Another server, or the same one again: ask at once, quickly at first.
  void start(Nanoseconds now);
  Nanoseconds due_at() const { return due_at_; }
  /// The number of the question that goes now.
  std::uint64_t ask(Nanoseconds now);
  void on(const ClockReply& reply, Nanoseconds now);

  /// @param same_machine  then the clocks are one, unless the answers say otherwise (another time
  /// namespace)
  ClockEstimate at(Nanoseconds now, bool same_machine) const;

 private:
  struct Question {
    std::uint64_t number{};
    Nanoseconds asked{-1};  ///< -1: answered, or free.
  };
  std::array<Question, 32> questions_{};
  std::uint64_t next_number_;
  int asked_{0};
  Nanoseconds due_at_{0};
  ClockFilter filter_;
};

}  // namespace fiducap::sdk
