#pragma once

#include <array>
#include <cstddef>

#include "base/cpu_time.hpp"

namespace fiducap {

/// Splits the CPU time of one thread among stages: from `enter` until the next `enter` it belongs
/// to that stage. One system call per change, so change per image and not per sample.
template <typename Stage, std::size_t Count>
class StageClock final {
 public:
  void enter(Stage stage) {
    const Duration now = thread_cpu_time();
    if (running_) total_[current_] += now - since_;
    since_ = now;
    current_ = static_cast<std::size_t>(stage);
    running_ = true;
  }
  void leave() {
    if (running_) total_[current_] += thread_cpu_time() - since_;
    running_ = false;
  }
  [[nodiscard]] double seconds(Stage stage) const {
    return to_seconds(total_[static_cast<std::size_t>(stage)]);
  }

 private:
  std::array<Duration, Count> total_{};
  Duration since_{0};
  std::size_t current_{0};
  bool running_{false};
};

}  // namespace fiducap
