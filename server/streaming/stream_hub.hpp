#pragma once

#include <memory>
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
  [[nodiscard]] std::vector<ClientStatus> clients() const {
    std::vector<ClientStatus> all;
    each([&](const Streamer& streamer) { streamer.append_clients(all); });
    return all;
  }
  void stop() {
    each([](Streamer& streamer) { streamer.stop(); });
  }

 private:
  template <typename Work>
  void each(Work&& work) const {
    for (const auto& streamer : streamers_) {
      net::guarded(
          streamer->protocol(), [] { return "a frame"; }, [&] { work(*streamer); });
    }
  }

  std::vector<std::unique_ptr<Streamer>> streamers_;
};

}  // namespace fiducap
