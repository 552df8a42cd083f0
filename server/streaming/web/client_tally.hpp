#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "streaming/streamer.hpp"

namespace fiducap::web {

/// What a protocol has done since the server began to look.
struct Traffic {
  std::uint64_t clients{};  ///< Now.
  std::uint64_t sent{};     ///< Frames; of clients that left, too.
  std::uint64_t dropped{};
};

/// Adds up what clients come and go with, so that the sums never fall. It is shown the list of
/// clients now and then; who comes and goes in between is missed.
class ClientTally final {
 public:
  void note(std::span<const ClientStatus> clients) {
    std::map<std::string, Counters> now;
    for (auto& [protocol, traffic] : traffic_) traffic.clients = 0;
    for (const auto& client : clients) {
      std::string key = client.protocol + ' ' + client.peer;
      const auto known = known_.find(key);
      const Counters before = known == known_.end() ? Counters{} : known->second;
      Traffic& traffic = traffic_[client.protocol];
      ++traffic.clients;
      traffic.sent += increase(before.sent, client.frames_sent);
      traffic.dropped += increase(before.dropped, client.frames_dropped);
      now.insert_or_assign(std::move(key), Counters{client.frames_sent, client.frames_dropped});
    }
    known_ = std::move(now);
  }
  /// By protocol.
  [[nodiscard]] const std::map<std::string, Traffic>& traffic() const { return traffic_; }

 private:
  struct Counters {
    std::uint64_t sent{};
    std::uint64_t dropped{};
  };
  /// A count that fell is another client's of the same address.
  static std::uint64_t increase(std::uint64_t before, std::uint64_t now) {
    return now < before ? now : now - before;
  }

  std::map<std::string, Counters> known_;
  std::map<std::string, Traffic> traffic_;
};

}  // namespace fiducap::web
