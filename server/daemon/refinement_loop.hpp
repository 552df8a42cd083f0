#pragma once

#include <functional>
#include <stop_token>
#include <utility>

#include "base/clock.hpp"
#include "mapping/map_refiner.hpp"

namespace fiducap {

/// Brings the map up to date every `period_s`, on a thread of its own: a solution takes as long as
/// it takes, in another thread that runs where nobody else wants to, and no body waits for it. What
/// is thrown costs a round.
class RefinementLoop final {
 public:
  /// @param done  called after each, on that thread
  RefinementLoop(MapBuilder& map, double period_s, const Clock& clock,
                 std::function<void(const RefinementTurn&)> done)
      : refiner_(map), period_(from_seconds(period_s)), clock_(clock), done_(std::move(done)) {}

  /// Until stopped.
  void run(std::stop_token stop);

 private:
  [[nodiscard]] bool solve(const std::stop_token& stop);

  MapRefiner refiner_;
  Duration period_;
  const Clock& clock_;
  std::function<void(const RefinementTurn&)> done_;
};

}  // namespace fiducap
