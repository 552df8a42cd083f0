#pragma once

#include <cstddef>
#include <cstdint>

#include "base/time.hpp"

namespace fiducap::natnet {

enum class Message : std::uint16_t {
  kConnect = 0,  // 2.x: ping
  kServerInfo = 1,
  kRequest = 2,
  kResponse = 3,
  kRequestModel = 4,
  kModel = 5,
  kRequestFrame = 6,
  kFrame = 7,
  kText = 8,
  kDisconnect = 9,
  kKeepAlive = 10,
  kDisconnectByTimeout = 11,
  kEchoRequest = 12,
  kEchoResponse = 13,
  kDiscovery = 14,
  kUnrecognized = 100,
};

inline constexpr std::size_t kHeaderSize = 4;  ///< u16 message, u16 bytes of payload.
/// One message is one datagram: the most that IPv4 UDP carries. IP fragments it, nothing above does.
inline constexpr std::size_t kMaxDatagram = 65507;
inline constexpr std::size_t kMaxPayload = kMaxDatagram - kHeaderSize;
/// What the vendor's clients have room for.
inline constexpr std::size_t kMaxBodies = 1000;
/// Rigid body name, without its NUL.
inline constexpr std::size_t kMaxName = 255;
/// Text of an answer, NUL included: a sample client copies it into 260 bytes.
inline constexpr std::size_t kMaxText = 256;
/// Ticks per second of every tick count; they count from the epoch of the server's monotonic clock. 10 MHz as the
/// commercial server's on Windows: a client that misreads SERVERINFO by 4 bytes takes the lowest byte for the version,
/// and with this one (0x80) still finds its way.
inline constexpr std::uint64_t kClockFrequency = 10'000'000;
[[nodiscard]] constexpr std::int64_t ticks(Instant at) {
  return to_ns(at) / static_cast<std::int64_t>(1'000'000'000 / kClockFrequency);
}

}  // namespace fiducap::natnet
