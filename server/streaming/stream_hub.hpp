#pragma once

#include <memory>
#include <vector>

#include "streaming/streamer.hpp"

namespace fiducap {

/// The same immutable frame to every protocol. Lives on the I/O thread.
class StreamHub final {
 public:
  void add(std::unique_ptr<Streamer> streamer) { streamers_.push_back(std::move(streamer)); }

  void publish(const std::shared_ptr<const SceneFrame>& frame) {
    for (const auto& streamer : streamers_) streamer->publish(frame);
  }
  [[nodiscard]] std::vector<ClientStatus> clients() const {
    std::vector<ClientStatus> all;
    for (const auto& streamer : streamers_) streamer->append_clients(all);
    return all;
  }
  void stop() {
    for (const auto& streamer : streamers_) streamer->stop();
  }

 private:
  std::vector<std::unique_ptr<Streamer>> streamers_;
};

}  // namespace fiducap
