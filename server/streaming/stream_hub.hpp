#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "streaming/net/guard.hpp"
#include "streaming/streamer.hpp"

namespace fiducap {

/// The same immutable frame to every protocol. What one of them throws costs it this frame, and the
/// others nothing. Lives on one I/O thread.
class StreamHub final {
 public:
  void add(std::unique_ptr<Streamer> streamer) { streamers_.push_back(std::move(streamer)); }

  [[nodiscard]] bool empty() const { return streamers_.empty(); }

  void publish(const std::shared_ptr<const SceneFrame>& frame) {
    each([&](Streamer& streamer) { streamer.publish(frame); });
    if (wanted_) show_clients();
  }
  [[nodiscard]] std::vector<ClientStatus> clients() {
    std::vector<ClientStatus> all;
    each([&](const Streamer& streamer) { streamer.append_clients(all); });
    return all;
  }
  /// From any thread: the clients at the first frame after this was last called.
  [[nodiscard]] std::shared_ptr<const std::vector<ClientStatus>> shown_clients() {
    wanted_ = true;
    const std::lock_guard lock(showing_);
    return shown_;
  }
  void stop() {
    each([](Streamer& streamer) { streamer.stop(); });
  }

 private:
  void show_clients() {
    net::guarded(
        "streaming", [] { return "the list of clients"; },
        [this] {
          auto now = std::make_shared<const std::vector<ClientStatus>>(clients());
          // Who holds it may have to wait for a processor; frames do not wait for that.
          const std::unique_lock lock(showing_, std::try_to_lock);
          if (!lock) return;
          shown_.swap(now);
          wanted_ = false;
        });
  }
  template <typename Work>
  void each(Work&& work) {
    // One of a thousand is said, the first at once: frames come too often for the log.
    const auto whose = [this] {
      return failures_++ % 1000 == 0 ? std::string("a frame") : std::string();
    };
    for (const auto& streamer : streamers_) {
      net::guarded(streamer->protocol(), whose, [&] { work(*streamer); });
    }
  }

  std::vector<std::unique_ptr<Streamer>> streamers_;
  std::uint64_t failures_{0};
  std::atomic<bool> wanted_{false};
  std::mutex showing_;
  std::shared_ptr<const std::vector<ClientStatus>> shown_{
      std::make_shared<const std::vector<ClientStatus>>()};
};

}  // namespace fiducap
