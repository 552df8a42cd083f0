#include "daemon/map_keeper.hpp"

#include <algorithm>
#include <condition_variable>
#include <future>
#include <thread>

#include "base/log.hpp"
#include "base/process.hpp"
#include "daemon/system.hpp"

namespace fiducap {
namespace {
// A solution that got less than this share of a core within this time is starved.
constexpr Duration kLate = std::chrono::seconds(5);
constexpr double kLeastShare = 0.2;
// A busy computer stays busy for some time.
constexpr Duration kNormalPriorityFor = std::chrono::minutes(5);
// After the first solution: bodies wait for tags.
constexpr Duration kNormalPriorityAtStart = std::chrono::seconds(30);
constexpr auto kLookEvery = std::chrono::seconds(1);
}  // namespace

/// Thread of all solutions: one heap arena holds the graph, which a thread per solution would
/// spread over many arenas. It never holds the map's lock, which bodies wait for.
class RefinementLoop::Solver final {
 public:
  explicit Solver(MapRefiner& refiner) : refiner_(refiner) { handle_ = ready_.get_future().get(); }

  void begin(bool in_background, const std::stop_token& stop) {
    began_cpu_ = handle_.cpu_time();
    const std::lock_guard lock(mutex_);
    job_.emplace([this, stop] { return refiner_.solve_taken(stop); });
    result_ = job_->get_future();
    in_background_ = in_background;
    wake_.notify_one();
  }
  /// @return whether it is done
  [[nodiscard]] bool wait() { return result_.wait_for(kLookEvery) == std::future_status::ready; }
  [[nodiscard]] bool get() { return result_.get(); }
  /// Of the solution under way.
  [[nodiscard]] Duration cpu_time() const { return handle_.cpu_time() - began_cpu_; }
  void restore_priority() { (void)restore_normal_priority(handle_.number); }

 private:
  void run(const std::stop_token& stop) {
    name_this_thread("solve");
    ready_.set_value(this_thread());
    std::unique_lock lock(mutex_);
    while (wake_.wait(lock, stop, [this] { return job_.has_value(); })) {
      auto job = std::move(*job_);
      job_.reset();
      const bool in_background = in_background_;
      lock.unlock();
      if (in_background)
        set_reversible_background_priority();
      else
        restore_priority();
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
  bool in_background_{false};
  std::jthread thread_{[this](const std::stop_token& stop) { run(stop); }};
};

void RefinementLoop::run(std::stop_token stop) {
  Solver solver(refiner_);
  Instant next = clock_.now() + period_;
  while (clock_.wait_until(next, stop)) {
    log::guarded(
        "mapping", [] { return "refining the map"; },
        [&] {
          refiner_.take();
          const bool is_solved = solve(solver, stop);
          if (!is_solved && stop.stop_requested()) return;  // incomplete: not reproducible
          if (const auto turn = refiner_.adopt(utc_now_ns())) done_(*turn);
          if (is_solved && !std::exchange(has_map_, true))
            background_from_ = std::max(background_from_, clock_.now() + kNormalPriorityAtStart);
        });
    next = std::max(next + period_, clock_.now());
  }
}

bool RefinementLoop::solve(Solver& solver, const std::stop_token& stop) {
  const Instant began = clock_.now();
  const bool in_background = has_map_ && began >= background_from_;
  solver.begin(in_background, stop);
  const std::stop_callback stopped(stop, [&] { solver.restore_priority(); });
  bool is_late = false;
  while (!solver.wait()) {
    const Duration waited = clock_.now() - began;
    const Duration used = solver.cpu_time();
    if (is_late || waited < kLate || used > kLeastShare * waited) continue;
    is_late = true;
    report_lateness(true);
    if (in_background) solver.restore_priority();
    background_from_ = clock_.now() + kNormalPriorityFor;
  }
  if (!is_late) report_lateness(false);
  return solver.get();
}

void RefinementLoop::report_lateness(bool is_late) {
  events_.set(
      is_late,
      {.severity = Severity::kWarning,
       .subject = "map",
       .kind = "map_late",
       .text =
           "is refined late because of other work. Tags join late, and moved tags are noticed late",
       .remedy =
           "End other programs, lower the cameras' rates, or take a computer with more cores"},
      "is refined in time again");
}

}  // namespace fiducap
