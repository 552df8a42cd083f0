#include "daemon/refinement_loop.hpp"

#include <algorithm>
#include <future>

#include "base/this_thread.hpp"
#include "daemon/system_clock.hpp"
#include "daemon/urgency.hpp"
#include "streaming/net/guard.hpp"

namespace fiducap {

namespace {
// A solution that is under way for this long and got less than this share of a core is starved.
constexpr Duration kLate = std::chrono::seconds(5);
constexpr double kLeastShare = 0.2;
// A busy computer does not get idle from one solution to the next.
constexpr Duration kImpatientFor = std::chrono::minutes(5);
// After the first solution: bodies wait for the tags that they see.
constexpr Duration kBeginsFor = std::chrono::seconds(30);
constexpr auto kLookEvery = std::chrono::seconds(1);
}  // namespace

/// One solution, under way in a thread of its own, which never holds the map's lock: bodies wait
/// for that.
class RefinementLoop::Solving final {
 public:
  Solving(MapRefiner& refiner, bool is_patient, const std::stop_token& stop)
      : is_patient_(is_patient),
        result_(std::async(std::launch::async,
                           [this, &refiner, stop] {
                             name_this_thread("solve");
                             if (is_patient_) run_patiently_for_now();
                             begun_.set_value(this_thread());
                             return refiner.solve_taken(stop);
                           })),
        thread_(begun_.get_future().get()) {}

  /// @return whether it is done
  [[nodiscard]] bool wait() { return result_.wait_for(kLookEvery) == std::future_status::ready; }
  [[nodiscard]] bool get() { return result_.get(); }
  [[nodiscard]] Duration cpu_time() const { return thread_.cpu_time(); }
  void hurry() {
    if (std::exchange(is_patient_, false)) (void)lose_patience(thread_.number);
  }

 private:
  bool is_patient_;
  std::promise<ThreadHandle> begun_;
  std::future<bool> result_;
  ThreadHandle thread_;
};

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
          if (is_solved && !std::exchange(has_map_, true))
            patient_from_ = std::max(patient_from_, clock_.now() + kBeginsFor);
        });
    next = std::max(next + period_, clock_.now());
  }
}

bool RefinementLoop::solve(const std::stop_token& stop) {
  const Instant began = clock_.now();
  Solving solving(refiner_, has_map_ && began >= patient_from_, stop);
  bool is_late = false;
  while (!solving.wait()) {
    const Duration waited = clock_.now() - began;
    const Duration used = solving.cpu_time();
    if (is_late || waited < kLate || used == Duration{} || used > kLeastShare * waited) continue;
    is_late = true;
    say_whether_late(true);
    solving.hurry();
    patient_from_ = clock_.now() + kImpatientFor;
  }
  if (!is_late) say_whether_late(false);
  return solving.get();
}

void RefinementLoop::say_whether_late(bool is_late) {
  events_.set(is_late,
              {.severity = Severity::kWarning,
               .subject = "map",
               .kind = "map_late",
               .text = "is brought up to date late: other work leaves it no time. Tags join late, "
                       "and what has moved is noticed late",
               .remedy = "End other programs, lower the cameras' rates, or take a computer with "
                         "more cores"},
              "is brought up to date in time again");
}

}  // namespace fiducap
