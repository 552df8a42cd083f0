#pragma once

#include <functional>
#include <stop_token>
#include <utility>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "mapping/map_refiner.hpp"

namespace fiducap {

/// Brings the map up to date every `period_s`, on a thread of its own: a solution takes as long as
/// it takes, in another thread that runs where nobody else wants to, and no body waits for it. A
/// stop abandons the solution under way. What is thrown costs a round. Where nobody leaves it time
/// the map would never grow: that is said
/// (`map_late`), and it then runs like any other thread. So do the first solutions, without which
/// there are no tags: bodies without a place search every image whole, which fills a small computer
/// (eight robots on one core: 130 %), and ends only when there is a map. Without the right to come
/// back from there (urgency), all do.
class RefinementLoop final {
 public:
  /// @param done  called after each, on that thread
  RefinementLoop(MapBuilder& map, double period_s, const Clock& clock, EventBoard& events,
                 std::function<void(const RefinementTurn&)> done)
      : refiner_(map),
        period_(from_seconds(period_s)),
        clock_(clock),
        events_(events),
        done_(std::move(done)) {}

  /// Until stopped.
  void run(std::stop_token stop);

 private:
  class Solver;
  [[nodiscard]] bool solve(Solver& solver, const std::stop_token& stop);
  void say_whether_late(bool is_late);

  MapRefiner refiner_;
  Duration period_;
  const Clock& clock_;
  EventBoard& events_;
  std::function<void(const RefinementTurn&)> done_;
  bool has_map_{false};
  Instant patient_from_{};  ///< Until then solutions take their time.
};

}  // namespace fiducap
