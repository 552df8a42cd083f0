#include "daemon/refinement_loop.hpp"

#include <algorithm>
#include <condition_variable>
#include <future>
#include <mutex>
#include <thread>

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

/// The one thread that all solutions run in: its heap arena keeps the graph, where a thread for
/// each solution would spread it over as many arenas as there are. It never holds the map's lock:
/// bodies wait for that.
class RefinementLoop::Solver final {
 public:
  explicit Solver(MapRefiner& refiner) : refiner_(refiner) { handle_ = ready_.get_future().get(); }

  void begin(bool is_patient, const std::stop_token& stop) {
    began_cpu_ = handle_.cpu_time();
    const std::lock_guard lock(mutex_);
    job_.emplace([this, stop] { return refiner_.solve_taken(stop); });
    result_ = job_->get_future();
    is_patient_ = is_patient;
    wake_.notify_one();
  }
  /// @return whether it is done
  [[nodiscard]] bool wait() { return result_.wait_for(kLookEvery) == std::future_status::ready; }
  [[nodiscard]] bool get() { return result_.get(); }
  /// Of the solution under way.
  [[nodiscard]] Duration cpu_time() const { return handle_.cpu_time() - began_cpu_; }
  void hurry() { (void)lose_patience(handle_.number); }

 private:
  void run(const std::stop_token& stop) {
    name_this_thread("solve");
    ready_.set_value(this_thread());
    std::unique_lock lock(mutex_);
    while (wake_.wait(lock, stop, [this] { return job_.has_value(); })) {
      auto job = std::move(*job_);
      job_.reset();
      const bool is_patient = is_patient_;
      lock.unlock();
      if (is_patient)
        run_patiently_for_now();
      else
        hurry();
      job();
      lock.lock();
    }
  }

  MapRefiner& refiner_;
  std::promise<ThreadHandle> ready_;
  ThreadHandle handle_;
  Duration began_cpu_{};
  std::future<bool> result_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::optional<std::packaged_task<bool()>> job_;
  bool is_patient_{false};
  std::jthread thread_{[this](const std::stop_token& stop) { run(stop); }};
};

void RefinementLoop::run(std::stop_token stop) {
  Solver solver(refiner_);
  Instant next = clock_.now() + period_;
  while (clock_.wait_until(next, stop)) {
    net::guarded(
        "mapping", [] { return "refining the map"; },
        [&] {
          refiner_.take();
          const bool is_solved = solve(solver, stop);
          if (!is_solved && stop.stop_requested()) return;  // in its middle: no replay could
          if (const auto turn = refiner_.adopt(utc_now_ns())) done_(*turn);
          if (is_solved && !std::exchange(has_map_, true))
            patient_from_ = std::max(patient_from_, clock_.now() + kBeginsFor);
        });
    next = std::max(next + period_, clock_.now());
  }
}

bool RefinementLoop::solve(Solver& solver, const std::stop_token& stop) {
  const Instant began = clock_.now();
  bool is_patient = has_map_ && began >= patient_from_;
  solver.begin(is_patient, stop);
  const std::stop_callback stopped(stop, [&] { solver.hurry(); });
  bool is_late = false;
  while (!solver.wait()) {
    const Duration waited = clock_.now() - began;
    const Duration used = solver.cpu_time();
    if (is_late || waited < kLate || used > kLeastShare * waited) continue;
    is_late = true;
    say_whether_late(true);
    if (is_patient) solver.hurry();
    patient_from_ = clock_.now() + kImpatientFor;
  }
  if (!is_late) say_whether_late(false);
  return solver.get();
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
