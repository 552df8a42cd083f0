#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <ctime>

namespace fiducap {

/// CPU time of the calling thread, nanoseconds.
[[nodiscard]] inline std::int64_t thread_cpu_ns() {
  std::timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

/// Splits the CPU time of one thread among stages: from `enter` until the next `enter` it belongs to that stage.
/// One system call per change, so change per image and not per sample.
template <typename Stage, std::size_t Count>
class StageClock final {
 public:
  void enter(Stage stage) {
    const std::int64_t now = thread_cpu_ns();
    if (running_) total_ns_[current_] += now - since_ns_;
    since_ns_ = now;
    current_ = static_cast<std::size_t>(stage);
    running_ = true;
  }
  void leave() {
    if (running_) total_ns_[current_] += thread_cpu_ns() - since_ns_;
    running_ = false;
  }
  [[nodiscard]] double seconds(Stage stage) const {
    return static_cast<double>(total_ns_[static_cast<std::size_t>(stage)]) * 1e-9;
  }

 private:
  std::array<std::int64_t, Count> total_ns_{};
  std::int64_t since_ns_{0};
  std::size_t current_{0};
  bool running_{false};
};

}  // namespace fiducap
