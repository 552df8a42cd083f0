#pragma once

#include <cstdint>
#include <string>

#include "base/time.hpp"
#include "streaming/natnet/bitstream.hpp"
#include "streaming/natnet/peer.hpp"
#include "streaming/natnet/selection.hpp"

namespace fiducap::natnet {

/// One unicast client: gets frames at the address and port it asks from.
struct Subscriber {
  Peer peer;
  std::string name;  ///< As it calls itself, may be empty.
  Bitstream version;
  bool stranger{};   ///< Heard once: gets frames only as far as ReflectionGuard lets.
  bool fixed{};      ///< From the configuration: never asked, never forgotten.
  Instant since{};
  Instant heard_at{};
  Instant frames_from{};               ///< Nothing before: a slow start-up takes a frame for an answer.
  Instant bitstream_changed_until{};
  Selection selection;
  std::uint64_t frames_sent{};
  std::uint64_t frames_dropped{};  ///< The socket's buffer was full.
};

}  // namespace fiducap::natnet
