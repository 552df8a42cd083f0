#include "daemon/refinement_loop.hpp"

#include "daemon/system_clock.hpp"
#include "daemon/urgency.hpp"
#include "streaming/net/guard.hpp"

namespace fiducap {

void RefinementLoop::run(std::stop_token stop) {
  run_patiently();
  Instant next = clock_.now() + period_;
  while (clock_.wait_until(next, stop)) {
    net::guarded(
        "mapping", [] { return "refining the map"; },
        [&] {
          const bool is_solved = refiner_.solve(stop);
          if (!is_solved && stop.stop_requested()) return;  // in its middle: no replay could
          if (const auto turn = refiner_.adopt(utc_now_ns())) done_(*turn);
        });
    next = std::max(next + period_, clock_.now());
  }
}

}  // namespace fiducap
