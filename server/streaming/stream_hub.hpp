#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "streaming/net/guard.hpp"
#include "streaming/streamer.hpp"

namespace fiducap {

/// The same immutable frame to every protocol. What one of them throws costs it this frame, and the
/// others nothing. Lives on the I/O thread.
class StreamHub final {
 public:
  void add(std::unique_ptr<Streamer> streamer) { streamers_.push_back(std::move(streamer)); }

  void publish(const std::shared_ptr<const SceneFrame>& frame) {
    each([&](Streamer& streamer) { streamer.publish(frame); });
  }
  [[nodiscard]] std::vector<ClientStatus> clients() {
    std::vector<ClientStatus> all;
    each([&](const Streamer& streamer) { streamer.append_clients(all); });
    return all;
  }
  void stop() {
    each([](Streamer& streamer) { streamer.stop(); });
  }

 private:
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
};

}  // namespace fiducap
