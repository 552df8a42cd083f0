#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "daemon/bodies/body_worker.hpp"
#include "daemon/map_keeper.hpp"

namespace fiducap {

/// The workers of all bodies and the threads of each: one that computes, one per source.
class BodyThreads final {
 public:
  explicit BodyThreads(const Clock& clock) : clock_(clock) {}

  void add(std::unique_ptr<BodyWorker> worker) { workers_.push_back(std::move(worker)); }
  /// @param all_ended  called once, on a worker's thread, when no body has a source any more
  void start(std::function<void()> all_ended);
  /// Asks every thread to end and waits for them, but not longer than `patience` for a reader
  /// inside its device.
  /// @return false when one is left behind.
  [[nodiscard]] bool stop(Duration patience);
  /// One line per body. @pre stop() has returned
  void log_statistics() const;
  [[nodiscard]] std::vector<LearnedBody> learned() const;
  [[nodiscard]] const std::vector<std::unique_ptr<BodyWorker>>& workers() const { return workers_; }

 private:
  [[nodiscard]] bool some_are_reading() const;

  const Clock& clock_;
  std::vector<std::unique_ptr<BodyWorker>> workers_;
  std::atomic<std::size_t> running_{0};
  std::vector<std::jthread> computing_;
  struct ReadingThread {
    BodyWorker* body;
    std::size_t source;
    std::jthread thread;
  };
  std::vector<ReadingThread> reading_;  // die first: they feed the others
};

}  // namespace fiducap
