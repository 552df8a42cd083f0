#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::natnet {

/// Clients of the vendor's library that connected where they were told of a group, and were not
/// heard of again. In multicast mode it asks for the time at once; in unicast mode it ends.
class QuietConnects final {
 public:
  static constexpr Duration kPatience = std::chrono::seconds(3);
  static constexpr std::size_t kMost = 16;  ///< The oldest is forgotten for another.

  void asked(const net::Peer& peer, Instant now);
  void heard(const net::Peer& peer);
  /// One that has been quiet for too long, each once. @return nothing: no more of them
  [[nodiscard]] std::optional<net::Peer> next(Instant now);

 private:
  struct Asked {
    net::Peer peer;
    Instant at;
  };
  std::vector<Asked> asked_;  ///< Oldest first.
};

}  // namespace fiducap::natnet
