#include "daemon/refinement_loop.hpp"

#include <future>

#include "base/this_thread.hpp"
#include "daemon/system_clock.hpp"
#include "daemon/urgency.hpp"
#include "streaming/net/guard.hpp"

namespace fiducap {

void RefinementLoop::run(std::stop_token stop) {
  Instant next = clock_.now() + period_;
  while (clock_.wait_until(next, stop)) {
    net::guarded(
        "mapping", [] { return "refining the map"; },
        [&] {
          refiner_.take();
          const bool is_solved = solve(stop);
          if (!is_solved && stop.stop_requested()) return;  // in its middle: no replay could
          if (const auto turn = refiner_.adopt(utc_now_ns())) done_(*turn);
        });
    next = std::max(next + period_, clock_.now());
  }
}

/// Patiently, and therefore in a thread that never holds the map's lock: bodies wait for that.
bool RefinementLoop::solve(const std::stop_token& stop) {
  auto solving = std::async(std::launch::async, [this, &stop] {
    name_this_thread("solve");
    run_patiently();
    return refiner_.solve_taken(stop);
  });
  return solving.get();
}

}  // namespace fiducap
