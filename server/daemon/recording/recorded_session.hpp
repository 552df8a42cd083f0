#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <utility>

#include "streaming/operator_desk.hpp"

namespace fiducap {

/// One recording of all bodies, from its start until it is forgotten. Workers, writer and operator
/// read and count in it without a lock.
class RecordedSession final {
 public:
  using State = RecordingStatus::State;

  explicit RecordedSession(std::string name) : name_(std::move(name)) {}

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] bool is_over() const {
    return state_ == State::kFinished || state_ == State::kFailed;
  }

  /// Its files are open; unless it is stopping already.
  void opened() {
    State starting = State::kStarting;
    state_.compare_exchange_strong(starting, State::kRecording);
  }
  /// Unless it has failed.
  void stopping() {
    for (State now = state_; now != State::kFailed;)
      if (state_.compare_exchange_weak(now, State::kStopping)) return;
  }
  void finished() { state_ = State::kFinished; }
  /// Once, by the writer.
  void failed(std::string reason) {
    reason_ = std::move(reason);
    state_ = State::kFailed;  // from here on the reason may be read
  }

  void on_disk(std::uint64_t samples, std::uint64_t bytes) {
    samples_ = samples;
    bytes_ = bytes;
  }
  void on_disk(std::uint64_t bytes) { bytes_ = bytes; }
  void drop() { ++dropped_; }

  [[nodiscard]] RecordingStatus status() const {
    const State state = state_;
    return {name_, state, state == State::kFailed ? reason_ : "", samples_, bytes_, dropped_};
  }

 private:
  const std::string name_;
  std::atomic<State> state_{State::kStarting};
  std::string reason_;
  std::atomic<std::uint64_t> samples_{0};
  std::atomic<std::uint64_t> bytes_{0};
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace fiducap
