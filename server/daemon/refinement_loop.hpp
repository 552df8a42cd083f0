#pragma once

#include <stop_token>

#include "base/clock.hpp"
#include "mapping/map_refiner.hpp"

namespace fiducap {

/// Brings the map up to date every `period_s`, on a thread of its own: a solution takes as long as
/// it takes, and no body waits for it. What is thrown costs a round.
class RefinementLoop final {
 public:
  RefinementLoop(MapBuilder& map, double period_s, const Clock& clock)
      : refiner_(map), period_(from_seconds(period_s)), clock_(clock) {}

  /// Until stopped.
  void run(std::stop_token stop);

 private:
  MapRefiner refiner_;
  Duration period_;
  const Clock& clock_;
};

}  // namespace fiducap
