#pragma once

#include <cstdint>
#include <optional>

#include "base/event_board.hpp"
#include "base/time.hpp"

namespace fiducap {

/// What the machine says of itself at one instant.
struct MachineState {
  std::optional<bool> clock_synchronised;  ///< nullopt: nobody says.
  std::size_t open_descriptors{0};
  std::size_t most_descriptors{0};  ///< 0: not known.
  std::uint64_t frames{0};          ///< Published.
  std::uint64_t missed{0};          ///< Ticks of the publisher.
};

/// Reads the first three.
[[nodiscard]] MachineState read_machine_state();

/// Says in words what is wrong with the computer, once, and when it is over.
class MachineHealth final {
 public:
  explicit MachineHealth(EventBoard& events) : events_(events) {}
  void look(const MachineState& state, Instant now);

 private:
  void judge_rate(const MachineState& state, Instant now);

  EventBoard& events_;
  bool said_unknown_clock_{false};
  MachineState counted_{};
  std::optional<Instant> counted_at_;
};

}  // namespace fiducap
